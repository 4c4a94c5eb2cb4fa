"""Rows of two measurements in one table: two groups of rows, in any order, that differ by one motion of the frame.

Rows of two machines, two set-ups of an instrument or two zeros of a drive that alternate in a table look like poor
repeatability. Two frames, each fitted to the rows that it fits better, explain at most 2/pi of the power of Gaussian noise in
one direction. They explain nearly all of the power where there are two distant groups.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.data import Dataset
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.findings import Doubt
from gtpin.diagnosis.inference.reestimate_noise import left_over
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.errors import warn
from gtpin.kinematics.rotations import frame_motions
from gtpin.typing import Floats, Mask

SWEEPS = 30
USUAL = (1.5e-5, 5e-5)
"""Assumed noise of a laser tracker, m and rad, for the weights of positions and orientations where no noise is declared."""
SHOWN = 8
"""Lines of rows that a message lists."""


@dataclass(frozen=True)
class Groups:
    """The mask (N,) of the smaller group, and the distance between the two groups' frames at the median row, m."""

    smaller: Mask
    apart: float


def two_groups(design: Design, left: Floats, sigma: tuple[float, float], priors: Priors = PRIORS) -> Groups | None:
    """Two groups of rows with different frames; None where residuals with one frame for all rows are hardly larger.

    Parameters
    ----------
    left
        (N, c) whitened residual of the geometry and the causes.
    sigma
        The instrument's noise of positions and orientations, m and rad, with which residuals are whitened.
    """
    c = design.components
    scale = np.array([sigma[0]] * 3 + [sigma[1]] * 3)[:c]
    errors = np.linalg.solve(design.whitening, left[..., None])[..., 0]
    y, F = errors / scale, _motions(design)[:, :c] / scale[:, None]
    centred = y - y.mean(axis=0)
    first = centred @ np.linalg.svd(centred, full_matrices=False)[2][0] > 0.0
    for _ in range(SWEEPS):
        off = [_left_by(F, y, group)[0] for group in (first, ~first)]
        now = (off[0] ** 2).sum(axis=1) < (off[1] ** 2).sum(axis=1)
        if (now == first).all():
            break
        first = now
    smaller = first if first.mean() <= 0.5 else ~first
    if smaller.mean() < priors.least_group:
        return None
    (one, a), (two, b) = (_left_by(F, y, group) for group in (smaller, ~smaller))
    both = np.where(smaller[:, None], one, two)
    whole, _ = _left_by(F, y, np.ones(len(y), dtype=bool))
    if (whole**2).sum() < priors.two_groups * (both**2).sum():
        return None
    apart = np.linalg.norm((F @ (a - b))[:, :3] * scale[:3], axis=1)
    return Groups(smaller, float(np.median(apart)))


def with_one_measurement(found: Conclusion, hypotheses: HypothesisSet, dataset: Dataset) -> Conclusion:
    """The conclusion, with a doubt where apparent noise comes from two groups of rows.

    Parameters
    ----------
    dataset
        The rows that were searched.

    Warns
    -----
    GtpinWarning
        Lists the rows of the smaller group by their lines in the file.
    """
    if found.doubts:
        return found
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


def _left_by(F: Floats, y: Floats, group: Mask) -> tuple[Floats, Floats]:
    """(N, c) residuals of all rows with a frame fitted to a group, and the frame's motion (6,)."""
    flat = F[group].reshape(-1, 6)
    motion: Floats = np.asarray(np.linalg.lstsq(flat, y[group].ravel(), rcond=None)[0], dtype=np.float64)
    return y - F @ motion, motion


def _motions(design: Design) -> Floats:
    """(N, 6, 6) motions of the poses by shifts, m, and rotations, rad, of the frame about the mean position."""
    T = design.model.seen(design.situation.poses).T
    return frame_motions(T - T.mean(axis=0))
