"""Noise estimated from repeated visits of poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gtpin.distributions import chi2
from gtpin.noise.estimate import likeliest
from gtpin.noise.noise import SMALLEST, Noise

Floats = npt.NDArray[np.float64]

LEAST_CONTRASTS = 8
"""Fewest repeated visits, beyond the first of each pose, from which noise is estimated. Assumed."""


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


def from_repeats(noise: Noise, contrast: Floats, command_jacobian: Floats, declared: tuple[bool, bool]) -> Noise:
    """Noise from the scatter between visits: repeatability, and the sigmas that were not declared.

    Maximum likelihood over contrasts (k, c), with the derivative (k, 6, n) of the pose by the commands. Repeatability is zero
    where the scatter does not show it. Contrasts far larger than the others are shortened to a limit.

    Parameters
    ----------
    declared
        Whether the position's and the orientation's sigma are known.
    """
    components = contrast.shape[1]
    contrast = _tamed(contrast)
    spread = np.median(np.abs(contrast), axis=0) / 0.6745
    rough = np.maximum([np.median(spread[:3]), np.median(spread[3:]) if components == 6 else 1.0], SMALLEST)
    base = replace(
        noise,
        position_sigma=noise.position_sigma if declared[0] else rough[0],
        orientation_sigma=noise.orientation_sigma if declared[1] else rough[1],
    )
    found = likeliest(base, contrast, command_jacobian, declared)
    if all(declared):
        return replace(found, source="declared")
    return replace(found, source="repeats", dof=float(3 * len(contrast))).at_least(SMALLEST)


def _tamed(contrast: Floats) -> Floats:
    """Contrasts (k, c), shortened to the 97.5 % point of a Gaussian with the median of their sizes."""
    scaled = contrast / np.maximum(np.median(np.abs(contrast), axis=0), SMALLEST)
    norms = (scaled**2).sum(axis=1)
    c = contrast.shape[1]
    limit = chi2.ppf(0.975, c) * np.median(norms) / chi2.median(c)
    return np.asarray(contrast * np.sqrt(np.minimum(1.0, limit / np.maximum(norms, 1e-300)))[:, None])
