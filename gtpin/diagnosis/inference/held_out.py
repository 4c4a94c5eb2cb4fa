"""A conclusion held against what left-out poses and the rows of the data show."""

from __future__ import annotations

import numpy as np

from gtpin.data import Dataset
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.findings import Doubt
from gtpin.diagnosis.inference.reestimate_noise import left_over
from gtpin.diagnosis.inference.two_groups import two_groups
from gtpin.diagnosis.inference.unexplained import marginal_chance
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.errors import warn

USUAL = (1.5e-5, 5e-5)
"""Noise of a laser tracker, m and rad, by which positions are weighed against orientations where none is declared."""
SHOWN = 8
"""Lines of rows that a message lists."""


def held_out(found: Conclusion, hypotheses: HypothesisSet, whole: Gap, dataset: Dataset) -> Conclusion:
    """The conclusion; doubted where left-out poses are much farther off than noise, or rows are of two measurements.

    Parameters
    ----------
    whole
        The gap on left-out poses with all causes.
    dataset
        The rows that were searched.

    Warns
    -----
    GtpinWarning
        Of two groups of rows, with their lines.
    """
    most = hypotheses.priors.silent if found.verdict == "none" else hypotheses.priors.named
    if found.verdict == "unknown":
        return found
    if whole.after > most * whole.floor and marginal_chance(hypotheses, found.model) <= hypotheses.priors.chance:
        return found.doubted(Doubt("held_out"))
    return _of_one_measurement(found, hypotheses, dataset)


def _of_one_measurement(found: Conclusion, hypotheses: HypothesisSet, dataset: Dataset) -> Conclusion:
    """The conclusion; doubted where what passes for noise are two groups of rows, with a warning that names them."""
    instrument = dataset.instrument
    sigma = (instrument.position_sigma or USUAL[0], instrument.orientation_sigma or USUAL[1])
    groups = two_groups(hypotheses.design, left_over(hypotheses, found.model)[0], sigma, hypotheses.priors)
    if groups is None:
        return found
    lines = np.sort(dataset.row[groups.smaller])
    shown = ", ".join(str(line) for line in lines[:SHOWN])
    warn(
        f"the rows fall into two groups that differ by one motion of {1e3 * groups.apart:.2g} mm: {len(lines)} rows "
        f"({shown}, ...) against {len(groups.smaller) - len(lines)}: two machines, two set-ups of the instrument, a zero that "
        "moved, or play whose direction of approach was not recorded; give each group its session"
    )
    return found.doubted(Doubt("two_groups"))
