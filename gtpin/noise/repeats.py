"""Noise estimated from repeated visits of poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gtpin.distributions import chi2
from gtpin.noise.estimate import likeliest
from gtpin.noise.noise import SMALLEST
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats

LEAST_CONTRASTS = 8
"""Fewest repeated visits, beyond the first of each pose, from which noise is estimated. Assumed."""


def stops(q: Floats, read: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """(N,) index of each row's commands q (N, n) and of what it reads there (N,): rows of one index repeat one measurement."""
    kinds = np.column_stack([read, np.unique(q, axis=0, return_inverse=True)[1].ravel()])
    return np.asarray(np.unique(kinds, axis=0, return_inverse=True)[1].ravel(), dtype=np.intp)


def contrasts(visits: npt.NDArray[np.intp], values: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
    """Contrasts between visits of one pose: combinations of errors in which the pose's mean error cancels (Helmert's).

    Parameters
    ----------
    visits
        (N,) index of each row's pose.
    values
        (N, c) measured less predicted.

    Returns
    -------
    contrasts, rows
        (k, c) contrasts, each with the variance of a single visit and independent of the others; and (k,) for each the index
        of one row of its pose.
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
    found = likeliest(start, contrast, by_command, np.ones(len(contrast)))
    found = replace(found, estimated=noise.estimated, sigma=np.maximum(found.sigma, SMALLEST))
    if not noise.estimated.any():
        return replace(found, source="declared")
    return replace(found, source="repeats", dof=float(3 * len(contrast)))


def tamed(contrast: Floats, group: npt.NDArray[np.intp]) -> Floats:
    """Contrasts (k, c), shortened to the 97.5 % point of a Gaussian with the median of the sizes of those alike."""
    found, c = contrast.copy(), contrast.shape[1]
    for first in np.unique(group[:, 0]):
        rows = group[:, 0] == first
        scaled = contrast[rows] / np.maximum(np.median(np.abs(contrast[rows]), axis=0), SMALLEST)
        norms = (scaled**2).sum(axis=1)
        limit = chi2.ppf(0.975, c) * np.median(norms) / chi2.median(c)
        found[rows] = contrast[rows] * np.sqrt(np.minimum(1.0, limit / np.maximum(norms, 1e-300)))[:, None]
    return found
