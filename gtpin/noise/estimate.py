"""Noise by maximum likelihood, from errors or from repeated visits: the same for calibration and diagnosis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gtpin.distributions import chi2
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.typing import Floats, Indices

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
LEAST_CONTRASTS = 8
"""Fewest repeated visits, beyond the first of each pose, from which noise is estimated. Assumed."""
ENOUGH = 3000
"""Largest number of poses whose contrasts the likelihood has; more are slower, and hardly more accurate."""


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
    columns = errors.reshape(*errors.shape[:2], -1)
    each = np.ones(len(errors)) if count is None else count

    def trial(x: Floats) -> ReadingNoise:
        """The noise at x: repeatability in its unit, and the logs of the free sigmas over their first estimates."""
        sigma = noise.sigma.copy()
        sigma[open_] *= np.exp(x[1:])
        return replace(noise, sigma=np.maximum(sigma, SMALLEST), repeatability=unit * float(x[0]))

    def cost(x: Floats) -> float:
        lower = np.linalg.cholesky(trial(x).covariance(by_command, errors.shape[1]))
        whitened = np.linalg.solve(lower, columns)
        logs = (each * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)).sum()
        return float(logs + 0.5 * (each * weight * (whitened**2).sum(axis=(1, 2))).sum())

    free = len(open_)
    bounds = [(-MOST[1], MOST[1])] * free
    repeats, none = [(0.0, MOST[0]), *bounds], [(0.0, 0.0), *bounds]
    starts = [np.array([first] + [other] * free) for first, other in STARTS]
    best = min((_climbed(cost, start, repeats) for start in starts), key=cost)
    without = _climbed(cost, np.zeros(1 + free), none) if free else np.zeros(1)
    if 2.0 * (cost(without) - cost(best)) > SHOWN:
        return trial(_exactly(cost, best, repeats))
    return trial(_exactly(cost, without, none) if free else without)


def _climbed(cost: Callable[[Floats], float], start: Floats, bounds: list[tuple[float, float]]) -> Floats:
    """The x of smallest cost that is found from a start; the search is repeated from where it stopped while it gains."""
    from scipy.optimize import minimize

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
    from scipy.optimize import minimize

    found = minimize(cost, near, bounds=bounds, method="L-BFGS-B", jac="3-point", options={"ftol": 0.0, "gtol": EXACT})
    return np.asarray(found.x, dtype=np.float64)


def stops(q: Floats | Indices, read: Indices) -> Indices:
    """(N,) index of each row's commands q (N, n), or index of them, and of what it reads there (N,): equal for repetitions."""
    return np.asarray(np.unique(np.column_stack([read, q]), axis=0, return_inverse=True)[1].ravel(), dtype=np.intp)


def contrasts(visits: Indices, values: Floats) -> tuple[Floats, Indices]:
    """Contrasts between visits of one pose: combinations of errors in which the pose's mean error cancels (Helmert's).

    ``visits``: (N,) index of each row's pose. ``values``: (N, c) measured less predicted.

    Returns (k, c) contrasts, each with the variance of a single visit and independent of the others; and (k,) for each the
    index of one row of its pose. Those of one pose follow each other.
    """
    order = np.argsort(visits, kind="stable")
    begins = np.flatnonzero(np.diff(visits[order], prepend=-1))
    counts = np.diff(begins, append=len(order))
    found, rows = [np.zeros((0, values.shape[1]))], [np.zeros(0, dtype=np.intp)]
    for count in np.unique(counts[counts > 1]):  # all poses with the same number of visits together
        visit = order[begins[counts == count, None] + np.arange(count)]
        j = np.arange(1.0, count)[:, None]
        earlier = np.cumsum(values[visit[:, :-1]], axis=1) / j
        found.append(((earlier - values[visit[:, 1:]]) * np.sqrt(j / (j + 1.0))).reshape(-1, values.shape[1]))
        rows.append(visit[:, 1:].ravel())
    return np.concatenate(found), np.concatenate(rows)


def from_repeats(noise: ReadingNoise, contrast: Floats, by_command: Floats) -> ReadingNoise:
    """Noise from the scatter between visits: repeatability, and the sigmas that were not declared.

    Maximum likelihood over contrasts (k, c), with the derivative (k, c, n) of the readings by the commands; ``noise`` is that
    of the contrasts' rows. Repeatability is zero where the scatter does not show it. Contrasts far larger than the others are
    shortened to a limit. Sigmas of groups with fewer than ``LEAST_CONTRASTS`` contrasts stay as they are.
    """
    contrast = tamed(contrast, noise.group)
    sigma, open_ = noise.sigma.copy(), noise.estimated.copy()
    for group in np.flatnonzero(open_):
        own = np.abs(contrast[(noise.group == group) & ~np.isfinite(noise.row_sigma)])
        open_[group] = len(own) >= LEAST_CONTRASTS
        if open_[group]:
            sigma[group] = max(float(np.median(own)) / 0.6745, SMALLEST)
    start = replace(noise, sigma=sigma, estimated=open_, repeatability=0.0, model_discrepancy=0.0)
    rows, count, root = _alike(start, contrast, by_command)
    best = likeliest(start.take(rows), root, by_command[rows], np.ones(len(rows)), count)
    sigma = np.maximum(best.sigma, SMALLEST)
    found = replace(start, sigma=sigma, repeatability=best.repeatability, estimated=noise.estimated)
    if not noise.estimated.any():
        return replace(found, source="declared")
    return replace(found, source="repeats", dof=3.0 * float(count.sum()))


def _alike(noise: ReadingNoise, contrast: Floats, by_command: Floats) -> tuple[Indices, Floats, Floats]:
    """Contrasts in a row that have one covariance: first index (M,), number (M,), root (M, c, c) of the mean square."""
    parts = [by_command.reshape(len(contrast), -1), noise.group, np.nan_to_num(noise.row_sigma, nan=-1.0)]
    parts += [part.reshape(len(contrast), -1) for part in (noise.sight, noise.reach) if part is not None]
    differs = np.any([(part[1:] != part[:-1]).any(axis=1) for part in parts], axis=0)
    begins = np.concatenate([[0], np.flatnonzero(differs) + 1])
    ends = np.append(begins[1:], len(contrast))
    some = np.unique(np.linspace(0, len(begins) - 1, min(len(begins), ENOUGH)).round().astype(int))
    begins, ends = begins[some], ends[some]
    mean = np.array([contrast[a:b].T @ contrast[a:b] / (b - a) for a, b in zip(begins, ends, strict=True)])
    values, vectors = np.linalg.eigh(mean)
    return begins, (ends - begins).astype(np.float64), vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]


def tamed(contrast: Floats, group: Indices) -> Floats:
    """Contrasts (k, c), shortened to the 97.5 % point of a Gaussian with the median of the sizes of those alike.

    Shortening takes a part of the mean square of Gaussian contrasts too; all are enlarged by as much.
    """
    found, c = contrast.copy(), contrast.shape[1]
    most = chi2.ppf(0.975, c)
    kept = chi2.cdf(most, c + 2) + 0.025 * most / c  # of the mean square: E[min(x, most)] / c with x of chi-square
    for first in np.unique(group[:, 0]):
        rows = group[:, 0] == first
        scaled = contrast[rows] / np.maximum(np.median(np.abs(contrast[rows]), axis=0), SMALLEST)
        norms = (scaled**2).sum(axis=1)
        limit = most * np.median(norms) / chi2.median(c)
        found[rows] = contrast[rows] * np.sqrt(np.minimum(1.0, limit / np.maximum(norms, 1e-300)) / kept)[:, None]
    return found
