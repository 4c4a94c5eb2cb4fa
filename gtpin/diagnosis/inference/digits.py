"""Commands that were rounded or cut off on their way into the table: what that leaves is no effect of the machine."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset
from gtpin.data.rounding import EXACT
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.reestimate_noise import left_over
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.posterior import NOTHING
from gtpin.errors import warn

Floats = npt.NDArray[np.float64]

DIGITS = (1e-2, 5e-3, 1e-3, 5e-4, 1e-4, 5e-5)
"""Steps that commands may have been rounded to, m or rad, the coarsest first."""
VARIOUS = 0.5
"""Share of different commands from which they are no grid that somebody chose."""


def with_full_digits(found: Conclusion, hypotheses: HypothesisSet, dataset: Dataset) -> Conclusion:
    """The conclusion; without causes where something unknown has the size of the last digit of the commands.

    Parameters
    ----------
    dataset
        The rows that were searched.

    Warns
    -----
    GtpinWarning
        Names the step of the commands.
    """
    step = next((s for s in DIGITS if _multiples(dataset.q, s)), None)
    if found.verdict != "unknown" or step is None:
        return found
    left = left_over(hypotheses, NOTHING)[0]
    errors = np.linalg.solve(hypotheses.design.whitening, left[..., None])[:, :3, 0]
    if np.sqrt((errors**2).sum(axis=1).mean()) > hypotheses.priors.few_steps * step:
        return found
    warn(
        f"commands have steps of {1e3 * step:g} mm or mrad, and what is left is of that size: they look rounded or cut off; "
        "export more digits"
    )
    return found.only(hypotheses, [])


def _multiples(q: Floats, step: float) -> bool:
    """Whether commands are multiples of a step, and too many different ones to have been chosen by hand."""
    counts = q / step
    various = min(len(np.unique(column)) for column in np.round(counts).T) > VARIOUS * len(q)
    return various and bool(np.abs(counts - np.round(counts)).max() < EXACT)
