"""The likelihood of a noise model, and its maximum: the same for calibration and diagnosis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.typing import Floats

SHOWN = 3.84
"""Twice the gain in log likelihood from which repeatability is accepted (false-positive probability 2.5 %): repeatability
that chance alone suggests would make the estimated noise too large.
"""

STARTS = ((0.2, 0.0), (1.0, -0.6), (2.5, 0.0))
"""Starting points of the maximisation: repeatability in units of the position noise, and log of the free sigmas over their
first estimates. The likelihood has several maxima: repeatability much smaller than the noise, as large, and larger."""
MOST = (100.0, 5.0)
"""Upper bounds of both; the logs are also bounded below, by minus the second."""
RESTARTS = 5
"""Largest number of restarts from where the maximisation stopped: it can stop early where the likelihood is badly scaled."""
SETTLED = 1e-3
"""Gain in log likelihood by another start below which the maximisation has converged."""
EXACT = 1e-6
"""Slope of the log likelihood at which the last maximisation stops, or before that where rounding hides a smaller one; the
second derivative is about the number of residuals."""


def likeliest(
    noise: ReadingNoise, errors: Floats, by_command: Floats, weight: Floats, count: Floats | None = None
) -> ReadingNoise:
    """Maximum-likelihood noise from errors: repeatability, and the sigmas that were not declared.

    Repeatability is zero where the errors do not show it.

    ``noise``: first estimate of the sigmas. ``errors``, ``count``: (N, c) measured less predicted, m and rad. With
    ``count`` (N,): (N, c, c) roots of the mean squares of so many errors that have one covariance. ``by_command``: (N, c,
    n) derivative of the readings by the commands. ``weight``: (N,) factors of the rows' squared errors.
    """
    present = np.bincount(noise.group[~np.isfinite(noise.row_sigma)], minlength=len(noise.sigma)) > 0
    open_ = np.flatnonzero(noise.estimated & present)
    # The unit of repeatability: it moves the readings by as much as their noise.
    moved = np.sqrt((by_command[:, : errors.shape[1]] ** 2).sum(axis=2))
    some = moved > 0.0
    unit = float(np.median(noise.each[some] / moved[some])) if some.any() else 0.0

    def trial(x: Floats) -> ReadingNoise:
        sigma = noise.sigma.copy()
        sigma[open_] *= np.exp(x[1:])
        return replace(noise, sigma=np.maximum(sigma, SMALLEST), repeatability=unit * float(x[0]))

    return _likeliest_of(trial, len(open_), errors, by_command, weight, count)


def _likeliest_of(
    trial: Callable[[Floats], ReadingNoise],
    free: int,
    errors: Floats,
    by_command: Floats,
    weight: Floats,
    count: Floats | None,
) -> ReadingNoise:
    """Maximum-likelihood noise from errors, among the noises ``trial(x)``: see :func:`likeliest`.

    ``trial``: gives the noise for x (1 + free,): x[0] is the repeatability in a unit that moves the measured numbers by
    about one sigma; the others are the logs of the free sigmas over their first estimates. ``free``: number of free sigmas.
    ``errors``: (N, c) measured less predicted, m and rad; or (N, c, c) a root of the mean square, E E', of several errors
    with one covariance. ``by_command``: derivative by the commands that ``covariance`` of the noise takes. ``weight``: (N,)
    factors of the rows' squared errors. ``count``: (N,) number of errors of each row; None: 1.
    """
    columns = errors.reshape(*errors.shape[:2], -1)
    each = np.ones(len(errors)) if count is None else count

    def cost(x: Floats) -> float:
        lower = np.linalg.cholesky(trial(x).covariance(by_command, errors.shape[1]))
        whitened = np.linalg.solve(lower, columns)
        logs = (each * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)).sum()
        return float(logs + 0.5 * (each * weight * (whitened**2).sum(axis=(1, 2))).sum())

    bounds = [(-MOST[1], MOST[1])] * free
    starts = [np.array([first] + [other] * free) for first, other in STARTS]
    best = min((_climbed(cost, start, [(0.0, MOST[0]), *bounds]) for start in starts), key=cost)
    without = np.zeros(1 + free)
    if free:
        without = _climbed(cost, without, [(0.0, 0.0), *bounds])
    if 2.0 * (cost(without) - cost(best)) > SHOWN:
        return trial(_exactly(cost, best, [(0.0, MOST[0]), *bounds]))
    return trial(_exactly(cost, without, [(0.0, 0.0), *bounds]) if free else without)


def _climbed(cost: Callable[[Floats], float], start: Floats, bounds: list[tuple[float, float]]) -> Floats:
    """The x of smallest cost that is found from a start; the search is repeated from where it stopped while it gains."""
    found = minimize(cost, start, bounds=bounds, method="L-BFGS-B")
    for _ in range(RESTARTS):
        again = minimize(cost, found.x, bounds=bounds, method="L-BFGS-B")
        gained = float(found.fun) - float(again.fun)
        found = again if gained > 0.0 else found
        if gained < SETTLED:
            break
    return np.asarray(found.x, dtype=np.float64)


def _exactly(cost: Callable[[Floats], float], near: Floats, bounds: list[tuple[float, float]]) -> Floats:
    """The minimum next to ``near``, with central differences: evidence depends on the sigmas, and rounding must not show."""
    found = minimize(cost, near, bounds=bounds, method="L-BFGS-B", jac="3-point", options={"ftol": 0.0, "gtol": EXACT})
    return np.asarray(found.x, dtype=np.float64)
