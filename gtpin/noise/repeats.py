"""Noise estimated from repeated visits of poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gtpin.distributions import chi2
from gtpin.noise.estimate import likeliest
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.typing import Floats

LEAST_CONTRASTS = 8
"""Fewest repeated visits, beyond the first of each pose, from which noise is estimated. Assumed."""
ENOUGH = 3000
"""Largest number of poses whose contrasts the likelihood has; more are slower, and hardly more accurate."""


def stops(q: Floats, read: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """(N,) index of each row's commands q (N, n) and of what it reads there (N,): rows of one index repeat one measurement."""
    kinds = np.column_stack([read, np.unique(q, axis=0, return_inverse=True)[1].ravel()])
    return np.asarray(np.unique(kinds, axis=0, return_inverse=True)[1].ravel(), dtype=np.intp)


def contrasts(visits: npt.NDArray[np.intp], values: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
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
    start = replace(noise, sigma=sigma, estimated=open_, repeatability=0.0, lack=0.0)
    rows, count, root = _alike(start, contrast, by_command)
    best = likeliest(start.take(rows), root, by_command[rows], np.ones(len(rows)), count)
    sigma = np.maximum(best.sigma, SMALLEST)
    found = replace(start, sigma=sigma, repeatability=best.repeatability, estimated=noise.estimated)
    if not noise.estimated.any():
        return replace(found, source="declared")
    return replace(found, source="repeats", dof=3.0 * float(count.sum()))


def _alike(noise: ReadingNoise, contrast: Floats, by_command: Floats) -> tuple[npt.NDArray[np.intp], Floats, Floats]:
    """Contrasts that follow each other and have one covariance, which is that of a pose visited often, as one row each.

    Gives the index of the first contrast of each row (M,), their number (M,), and a root (M, c, c) of their mean square: the
    likelihood needs no more. Of more than ``ENOUGH`` such rows, so many are taken at equal steps.
    """
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


def tamed(contrast: Floats, group: npt.NDArray[np.intp]) -> Floats:
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
