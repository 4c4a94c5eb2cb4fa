"""Noise by maximum likelihood, from errors or from repeated visits: the same for calibration and diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.distributions import chi2
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.typing import Floats, Indices, Mask

SHOWN = 3.84
"""Twice the gain in log likelihood from which repeatability is accepted (false-positive probability 2.5 %): repeatability
that chance alone suggests would make the estimated noise too large.
"""

STARTS = ((0.2, 1.0), (1.0, 0.5), (2.5, 1.0))
"""Starting points of the maximisation: repeatability in units of the instrument's noise, and the free sigmas over their first
estimates. The likelihood has several maxima: repeatability much smaller than the noise, as large, and larger."""
FARTHEST = (1e4, 150.0)
"""Largest factors on both; they are at least the inverse of it."""
NONE = -100.0
"""Log of a repeatability of no influence."""
SETTLED = 1e-9
"""Relative gain in log likelihood by a step below which the maxima are compared; the larger one is then found exactly."""
EXACT = 1e-6
"""Slope of the log likelihood at which the maximisation stops, or before that where rounding hides a smaller one; the second
derivative is about the number of residuals."""
LEAST_CONTRASTS = 8
"""Fewest repeated visits, beyond the first of each pose, from which noise is estimated. Assumed."""
LARGER, CHANCE = 1.2, 1e-3
"""Factor by which the scatter between visits exceeds a declared sigma, and p-value, from which the sigma is contradicted: as
``excess`` and ``chance`` of a diagnosis."""
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
    noise = replace(noise, sigma=np.maximum(noise.sigma, SMALLEST))
    present = np.bincount(noise.group[~np.isfinite(noise.row_sigma)], minlength=len(noise.sigma)) > 0
    open_ = np.flatnonzero(noise.estimated & present)
    c, columns = errors.shape[1], errors.reshape(*errors.shape[:2], -1)
    each = np.ones(len(errors)) if count is None else count
    # The unit of repeatability: it moves the reading that it moves most by as much as its noise.
    moved = (np.sqrt((by_command[:, :c] ** 2).sum(axis=2)) / noise.each).max(axis=1)
    unit = 1.0 / float(np.median(moved[moved > 0.0])) if (moved > 0.0).any() else 0.0

    def at(sigma: Floats, repeatability: float = 0.0) -> ReadingNoise:
        return replace(
            noise, sigma=np.where(noise.estimated & present, sigma, noise.sigma), repeatability=repeatability
        )

    # The covariance is linear in the squares of the repeatability and of the free sigmas.
    zeros = np.zeros_like(noise.sigma)
    fixed = at(zeros).covariance(by_command, c)
    parts = [at(zeros, unit), *(at(np.where(np.arange(len(zeros)) == group, noise.sigma, 0.0)) for group in open_)]
    shapes = np.array([part.covariance(by_command, c) - fixed for part in parts]).reshape(len(parts), -1)

    def cost(x: Floats) -> tuple[float, Floats]:
        """Minus the log likelihood, and its gradient, by the logs of repeatability, in its unit, and of the free sigmas, over
        their first estimates. By the covariance V it is (V^-1 - V^-1 S V^-1) / 2, with S the squared errors."""
        size = np.exp(2.0 * x)
        covariance = fixed + (size @ shapes).reshape(fixed.shape)
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        whitened = root @ columns
        logs = (each * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)).sum()
        value = 0.5 * (each * weight * (whitened**2).sum(axis=(1, 2))).sum() - logs
        turned = np.swapaxes(root, 1, 2)
        solved = turned @ whitened
        slope = turned @ root - weight[:, None, None] * (solved @ np.swapaxes(solved, 1, 2))
        return float(value), size * (shapes @ (each[:, None, None] * slope).ravel())

    reach = np.log(np.append(FARTHEST[0], np.full(len(open_), FARTHEST[1])))
    least = np.append(-reach[0], np.maximum(np.log(SMALLEST / noise.sigma[open_]), -reach[1:]))

    def climbed(start: Floats, most: Floats, gain: float = SETTLED) -> tuple[float, Floats]:
        """Minus the likelihood's logarithm at its maximum next to a start, and x there; it stops at a smaller relative gain."""
        from scipy.optimize import minimize

        bounds = list(zip(np.minimum(least, most).tolist(), most.tolist(), strict=True))
        found = minimize(cost, start, jac=True, bounds=bounds, method="L-BFGS-B", options={"ftol": gain, "gtol": EXACT})
        return float(found.fun), np.asarray(found.x, dtype=np.float64)

    starts = (np.log([repeatability] + [sigma] * len(open_)) for repeatability, sigma in STARTS)
    best, drives = min((climbed(np.maximum(start, least), reach) for start in starts), key=lambda found: found[0])
    none = np.append(NONE, reach[1:])
    without, still = climbed(np.minimum(none, 0.0), none)
    shown = 2.0 * (without - best) > SHOWN
    _, x = climbed(drives, reach, 0.0) if shown else climbed(still, none, 0.0)
    sigma = noise.sigma.copy()
    sigma[open_] *= np.exp(x[1:])
    return at(np.maximum(sigma, SMALLEST), unit * float(np.exp(x[0])) if shown else 0.0)


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
    start = replace(noise, sigma=sigma, estimated=open_, repeatability=0.0)
    rows, count, root = _alike(start, contrast, by_command)
    best = likeliest(start.take(rows), root, by_command[rows], np.ones(len(rows)), count)
    sigma = np.maximum(best.sigma, SMALLEST)
    found = replace(start, sigma=sigma, repeatability=best.repeatability, estimated=noise.estimated)
    if not noise.estimated.any():
        return replace(found, source="declared")
    return replace(found, source="repeats", dof=3.0 * float(count.sum()))


def misfit(noise: ReadingNoise, errors: Floats, by_command: Floats) -> float:
    """Minus twice the log likelihood of errors (N, c), but for a constant."""
    covariance = noise.covariance(by_command, errors.shape[1])
    solved = np.linalg.solve(covariance, errors[..., None])[..., 0]
    return float(np.linalg.slogdet(covariance)[1].sum() + (errors * solved).sum())


def contradicted(
    found: ReadingNoise, contrast: Floats, by_command: Floats, larger: float = LARGER, chance: float = CHANCE
) -> Mask:
    """(G,) declared sigmas that visits contradict: with other ones, larger by a factor, their scatter is much likelier.

    The sigma is wrong, or something changes between visits. ``found``, ``contrast``, ``by_command``: what
    :func:`from_repeats` gives and takes. ``larger``: the factor. ``chance``: largest p-value of the ratio of likelihoods.
    """
    tested = (np.bincount(found.group.ravel(), minlength=len(found.sigma)) >= LEAST_CONTRASTS) & ~found.estimated
    if not tested.any():
        return tested
    free = from_repeats(replace(found, estimated=found.estimated | tested), contrast, by_command)
    errors = tamed(contrast, found.group)
    gain = misfit(found, errors, by_command) - misfit(free, errors, by_command)
    return tested & (float(chi2.sf(gain, tested.sum())) <= chance) & (free.sigma > larger * found.sigma)


def within_residuals(noise: ReadingNoise, errors: Floats, by_command: Floats) -> ReadingNoise:
    """The noise that repeated visits show, or that of residuals where these are smaller and reject it by their likelihood.

    Residuals have the noise, and errors of the model besides: they bound the noise from above. ``errors``: (N, c) residuals,
    m and rad, enlarged for the parameters of the fit. ``by_command``: (N, c, n) derivative of the readings by the commands.
    """
    fewer = 1.0 - np.sqrt(2.0 / errors.size)  # chi-square of a number, less one standard deviation of the mean
    if noise.repeatability == 0.0 or (noise.whitened(by_command, errors) ** 2).mean() > fewer:
        return noise
    least = likeliest(noise, errors, by_command, np.ones(len(errors)))
    shown = misfit(noise, errors, by_command) - misfit(least, errors, by_command) > SHOWN
    return replace(noise, sigma=least.sigma, repeatability=least.repeatability) if shown else noise


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
