"""What repeats is not what is right: residuals are judged between poses, by the means of each pose's visits."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.gauss_newton import Fit
from gtpin.distributions import chi2, f
from gtpin.instruments.readings import Readings
from gtpin.model.fit_conditions import ModelDiscrepancy

Floats = npt.NDArray[np.float64]
Groups = npt.NDArray[np.intp]

LACK_OF_FIT = 1e-3
"""p-value of chi-square below which the model counts as incomplete. Assumed."""


def poses_of(*columns: npt.NDArray[np.generic]) -> Groups:
    """(N,) index of each row's pose: rows with the same commands (N, n) are visits of one pose."""
    return np.asarray(np.unique(np.column_stack(columns), axis=0, return_inverse=True)[1].ravel(), dtype=np.intp)


def places_of(measured: Readings) -> Groups:
    """(N, c) index of the pose and the component of each number: equal for what is read of one pose again and again.

    A known distance of sockets, which is assigned to several rows, is no repeated reading: each of its rows has its own index.
    """
    counted = measured.counted
    c = counted.shape[1]
    places: Groups = np.asarray(poses_of(measured.read, measured.q)[:, None] * c + np.arange(c), dtype=np.intp)
    parts = (counted > 0.0) & (counted < 1.0)
    places[parts] = places.max() + 1 + np.arange(np.count_nonzero(parts))
    return places


def mean_power(whitened: Floats, places: Groups, weight: Floats | None = None) -> float:
    """Sum of squares of the mean residuals of all places, each in units of the noise of such a mean.

    ``whitened``: (M,) residuals in units of the noise of a single visit. ``places``: (M,) index of the place of each.
    ``weight``: (M,) weights of a robust fit; None: 1.
    """
    weight = np.ones(len(whitened)) if weight is None else weight
    sums, weights = np.bincount(places, weight * whitened), np.bincount(places, weight)
    own = weights > 0.0
    return float((sums[own] ** 2 / weights[own]).sum())


def between(fit: Fit[Any]) -> tuple[float, float, float]:
    """Sums of squares of a fit's whitened and weighted residuals: of the means of the visits, and of single visits; and the
    number of the means. What is known in part counts as in ``counted`` of the measurement."""
    measured = fit.problem.measured
    counted = measured.counted.ravel()
    some = counted > 0.0
    places, left = places_of(measured).ravel()[some], fit.residual.ravel()[some]
    weight = np.repeat(fit.weight, fit.residual.shape[1])[some]
    own = np.unique(places, return_index=True)[1]
    return mean_power(left, places, weight), float((weight * left**2).sum()), float(counted[some][own].sum())


def unexplained_by(fit: Fit[Any], errors: Floats, variance: Floats, *, known: bool, dof: float) -> ModelDiscrepancy:
    """What a fit leaves unexplained between poses: the scatter of the poses' mean residuals beyond that of the noise.

    Repeated visits of a pose show the noise, and not whether the model is right at this pose. So a number of a pose counts
    once, with the mean of its visits, and the degrees of freedom are the count of these means less the parameters that were
    fitted.
    One standard deviation of the mean square is added. Where chi-square shows no unexplained errors, they are 0.

    ``fit``: the fit of N rows with c numbers each. ``errors``: (N, c) its residuals, m and rad. ``variance``: (N, c)
    variance of the noise of each number, m^2 or rad^2. ``known``: whether the noise was declared, or repeated visits showed
    it. Otherwise all residuals count as unexplained. ``dof``: degrees of freedom of the noise; infinite where it was
    declared.
    """
    measured = fit.problem.measured
    counted = measured.counted > 0.0
    places, turns = places_of(measured)[counted], measured.group_turns[measured.group][counted]
    visits = np.bincount(places)
    own = np.unique(places, return_index=True)[1]  # one number of each pose and component
    means, noise = (np.bincount(places, x[counted])[places[own]] / visits[places[own]] for x in (errors, variance))
    free = max(len(own) - fit.taken, 1.0)
    power = mean_power(fit.residual[counted], places)
    if known:
        chance = chi2.sf(power, free) if np.isinf(dof) else f.sf(power / free, free, dof)
        if chance >= LACK_OF_FIT:
            return ModelDiscrepancy(0.0, 0.0)

    def size(some: npt.NDArray[np.bool_]) -> float:
        if not some.any():
            return 0.0
        seen = float((means[some] ** 2).mean()) * len(own) / free * (1.0 + np.sqrt(2.0 / free))
        random = float((noise[some] / visits[places[own]][some]).mean()) if known else 0.0
        return float(np.sqrt(max(seen - random, 0.0)))

    return ModelDiscrepancy(size(~turns[own]), size(turns[own]), known)
