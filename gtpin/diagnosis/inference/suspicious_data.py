"""Faults of the data that look like an effect or like scatter: each makes the verdict unknown, or removes causes."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp

from gtpin.data import Dataset
from gtpin.data.duplicates import command_steps
from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, HypothesisSet
from gtpin.diagnosis.inference.findings import Conclusion, Doubt
from gtpin.diagnosis.inference.reestimate_noise import left_over
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.posterior import NOTHING
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import warn
from gtpin.kinematics.rotations import frame_motions
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats, Mask

COARSEST = 2e-2
"""Step of commands, m or rad, above which they are a grid that was chosen on purpose. Assumed: 1 degree is below it."""
VARIOUS = 0.5
"""Share of distinct commands of a drive above which they are not a grid that was chosen on purpose."""


def with_full_digits(found: Conclusion, hypotheses: HypothesisSet, dataset: Dataset) -> Conclusion:
    """The conclusion; without causes where the verdict is ``unknown`` and the errors are as small as the commands' last digit.

    ``dataset``: the rows that were searched.

    Warns (`GtpinWarning`): names the step of the commands.
    """
    if found.verdict != "unknown":
        return found
    steps = command_steps(dataset.q, hypotheses.design.operating_points.robot.revolute)
    if steps is None:
        return found
    step = float(steps.size[np.isfinite(steps.size)].max())
    # Multiples of a step, with too many distinct ones for a grid chosen on purpose.
    various = min(len(np.unique(column)) for column in np.round(dataset.q, 12).T) > VARIOUS * len(dataset)
    if step > COARSEST or not various:
        return found
    residual = left_over(hypotheses, NOTHING)[0]
    errors = hypotheses.design.coloured(residual)[:, :3]
    if np.sqrt((errors**2).sum(axis=1).mean()) > hypotheses.priors.few_steps * step:
        return found
    size = steps.words if "degrees" in steps.words else f"{1e3 * step:g} mm or mrad"
    warn(
        f"commands have steps of {size}, and what is left is of that size: they look rounded or cut off; export more digits"
    )
    return found.only(hypotheses, [])


SWEEPS = 30
USUAL = (1.5e-5, 5e-5)
"""Assumed noise of a laser tracker, m and rad, for the weights of positions and orientations where no noise is declared."""
SHOWN = 8
"""Lines of rows that a message lists."""


@dataclass(frozen=True)
class RowGroups:
    """The mask (N,) of the smaller group, and the distance between the two groups' frames at the median row, m."""

    smaller: Mask
    apart: float


def two_groups(
    design: Design, residual: Floats, sigma: tuple[float, float], priors: Priors = PRIORS
) -> RowGroups | None:
    """Two groups of rows with different frames; None where residuals with one frame for all rows are hardly larger.

    ``residual``: (N, c) whitened residual of the geometry and the causes. ``sigma``: the instrument's noise of positions and
    orientations, m and rad, with which residuals are whitened.
    """
    c, T = design.components, design.model.in_instrument_frame(design.operating_points.poses).T
    scale = np.array([sigma[0]] * 3 + [sigma[1]] * 3)[:c]
    y, F = design.coloured(residual) / scale, frame_motions(T - T.mean(axis=0))[:, :c] / scale[:, None]
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
    return RowGroups(smaller, float(np.median(apart)))


def with_one_measurement(found: Conclusion, hypotheses: HypothesisSet, dataset: Dataset) -> Conclusion:
    """The conclusion, with a doubt where apparent noise comes from two groups of rows.

    ``dataset``: the rows that were searched.

    Warns (`GtpinWarning`): Lists the rows of the smaller group by their lines in the file.
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


WIDTHS = np.linspace(0.3, 2.0, 18)
"""Half distances of the two values that are tried, in units of the errors' standard deviation."""
REST = np.linspace(0.0, 1.0, 9)
"""Standard deviations about each value, beyond the instrument's noise, that are tried, in the same units."""
SINGULAR = 1e12
"""Condition number above which the errors of the drives can't be distinguished."""
SHARES = (0.3, 0.5, 0.7)
"""Shares of the rows with the larger value, that are tried."""


def with_two_valued(hypotheses: HypothesisSet, found: Conclusion, noise: ReadingNoise) -> Conclusion:
    """The conclusion; where a drive's errors have two values: without the causes of this drive, and with a doubt.

    Nothing is changed where causes of the drive explain most of these errors.

    ``noise``: noise of the poses; only its instrument's part is used.
    """
    whole = drive_errors(hypotheses, found.model, noise)
    if whole is None or found.doubts:
        return found
    priors, sites = hypotheses.priors, hypotheses.design.operating_points.robot.sites
    least = max(priors.surely, priors.two_valued * len(whole.errors))
    for drive, site in enumerate(sites):
        others = hypotheses.only(found.model, [cause for cause in found.classes if cause.site != site])
        alone = drive_errors(hypotheses, others, noise)
        if alone is None or two_values(alone.errors[:, drive], alone.variance[:, drive]) < least:
            continue
        if whole.excess[drive] > priors.two_valued_left * alone.excess[drive]:
            kept = found.only(hypotheses, [cause for cause in found.beside_unknown() if cause.site != site])
            return kept.doubted(Doubt("two_valued", site, (f"approach{drive + 1}",)))
    return found


@dataclass(frozen=True)
class DriveErrors:
    """(N, n) errors of the drives, m or rad, and their variances by the instrument's noise alone."""

    errors: Floats
    variance: Floats

    @property
    def excess(self) -> Floats:
        """(n,) mean square of the errors beyond the instrument's noise; poses are weighted by how well they show the drive."""
        weight = self.variance**-2.0
        return np.asarray((weight * (self.errors**2 - self.variance)).sum(axis=0) / weight.sum(axis=0))


def drive_errors(hypotheses: HypothesisSet, model: Explanation, noise: ReadingNoise) -> DriveErrors | None:
    """Errors along each drive that remain after the geometry and a model were fitted.

    None where a pose has too few measured components to determine the errors of all drives.
    """
    design = hypotheses.design
    c = design.components
    J = design.by_command_seen
    if J.shape[2] > c:
        return None
    residual = design.coloured(left_over(hypotheses, model)[0])
    instrument = replace(noise, repeatability=0.0).covariance(J, c)
    seen = np.linalg.solve(instrument, J)
    information = np.swapaxes(J, 1, 2) @ seen
    if np.linalg.cond(information).max() > SINGULAR:
        return None
    covariance = np.linalg.inv(information)
    errors = np.einsum("nij,ncj,nc->ni", covariance, seen, residual)
    return DriveErrors(errors, np.diagonal(covariance, axis1=1, axis2=2))


def two_values(errors: Floats, variance: Floats) -> float:
    """Gain in log likelihood by two values instead of one, for errors (N,) with known variances (N,) and unknown scatter."""
    mean = np.average(errors, weights=1.0 / variance)
    spread = max(float(np.sqrt(np.average((errors - mean) ** 2, weights=1.0 / variance))), 1e-300)
    e, v = (errors - mean) / spread, variance / spread**2

    def one(rest: float) -> float:
        total = v + rest**2
        return float(0.5 * (np.log(total) + e**2 / total).sum())

    single = -float(minimize_scalar(one, bounds=(0.0, 2.0), method="bounded").fun)
    total = v + REST[:, None] ** 2  # (r, N)
    best = -np.inf
    for share in SHARES:
        # Two values with the mean 0.
        places = [2.0 * (1.0 - share) * WIDTHS, -2.0 * share * WIDTHS]
        logs = [
            np.log(part) - 0.5 * (np.log(total) + (e - place[:, None, None]) ** 2 / total)
            for part, place in zip((share, 1.0 - share), places, strict=True)
        ]
        best = max(best, float(logsumexp(logs, axis=0).sum(axis=2).max()))
    return best - single


_MOVES = re.compile(r"(approach|speed)[0-9]+")


def hidden_in_scatter(
    found: Conclusion, scatter: float, untestable: Iterable[Hypothesis], at: OperatingPoints, priors: Priors
) -> tuple[Hypothesis, ...]:
    """Effects of direction or speed whose columns were recorded, but left out because they contradict each other.

    Where no cause was found and the scatter is large relative to the instrument's noise, such an effect may cause the
    scatter. The verdict ``none`` would say that it was tested.

    ``scatter``: ratio of the drives' repeatability to the instrument's noise.
    """
    if found.verdict != "none" or scatter <= priors.scatters:
        return ()
    return tuple(
        hypothesis
        for hypothesis in untestable
        if any(_MOVES.fullmatch(name) and name in at.unusable for name in hypothesis.covariates(at.robot))
    )
