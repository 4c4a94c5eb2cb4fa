"""Scatter of a drive that has two values: play whose direction of approach is not known.

Repeatability is Gaussian. Play leaves a drive at one of two places, by its direction of approach; where the column ``approach``
is missing or wrong, that looks like scatter. Two normal densities then describe the drive's errors far better than one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp

from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet, Model
from gtpin.diagnosis.inference.findings import Doubt
from gtpin.diagnosis.inference.reestimate_noise import left_over
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats

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

    Parameters
    ----------
    noise
        Noise of the poses; only its instrument's part is used.
    """
    whole = drive_errors(hypotheses, found.model, noise)
    if whole is None or found.doubts:
        return found
    priors, sites = hypotheses.priors, hypotheses.design.situation.robot.sites
    least = max(priors.surely, priors.two_valued * len(whole.errors))
    for drive, site in enumerate(sites):
        others = hypotheses.only(found.model, [cause for cause in found.classes if cause.site != site])
        alone = drive_errors(hypotheses, others, noise)
        if alone is None or two_values(alone.errors[:, drive], alone.variance[:, drive]) < least:
            continue
        if whole.excess[drive] > priors.two_valued_left * alone.excess[drive]:
            kept = found.only(hypotheses, [cause for cause in found.sure() if cause.site != site])
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


def drive_errors(hypotheses: HypothesisSet, model: Model, noise: ReadingNoise) -> DriveErrors | None:
    """Errors along each drive that remain after the geometry and a model were fitted.

    None where a pose has too few measured components to determine the errors of all drives.
    """
    design = hypotheses.design
    c = design.components
    J = design.by_command_seen
    if J.shape[2] > c:
        return None
    left = np.einsum("nij,nj->ni", np.linalg.inv(design.whitening), left_over(hypotheses, model)[0])
    instrument = replace(noise, repeatability=0.0, lack=0.0).covariance(J, c)
    seen = np.linalg.solve(instrument, J)
    information = np.swapaxes(J, 1, 2) @ seen
    if np.linalg.cond(information).max() > SINGULAR:
        return None
    covariance = np.linalg.inv(information)
    errors = np.einsum("nij,ncj,nc->ni", covariance, seen, left)
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
