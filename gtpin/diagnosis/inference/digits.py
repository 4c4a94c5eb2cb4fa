"""Commands that were rounded or cut off in the table: residuals of that size are no effect of the machine."""

from __future__ import annotations

import numpy as np

from gtpin.data import Dataset
from gtpin.data.rounding import EXACT
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.reestimate_noise import left_over
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.posterior import NOTHING
from gtpin.errors import warn
from gtpin.typing import Floats

DIGITS = (1e-2, 5e-3, 1e-3, 5e-4, 1e-4, 5e-5)
"""Steps that commands may have been rounded to, m or rad, the coarsest first."""
VARIOUS = 0.5
"""Share of distinct commands of a drive above which they are not a grid that was chosen on purpose."""


def with_full_digits(found: Conclusion, hypotheses: HypothesisSet, dataset: Dataset) -> Conclusion:
    """The conclusion; without causes where the verdict is ``unknown`` and the errors are as small as the commands' last digit.

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
    """Whether commands are multiples of a step (m or rad), with too many distinct ones for a grid chosen on purpose."""
    counts = q / step
    various = min(len(np.unique(column)) for column in np.round(counts).T) > VARIOUS * len(q)
    return various and bool(np.abs(counts - np.round(counts)).max() < EXACT)
