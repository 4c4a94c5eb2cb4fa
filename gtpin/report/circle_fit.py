"""Least-squares circles of a commanded path in a plane, and of ranges along it."""

from __future__ import annotations

import numpy as np

from gtpin.typing import Floats

STEPS = 20
"""Largest number of steps of the fit of a centre."""
SMALLEST = 1e-12
"""Step, m, below which the fit has converged."""


def middle_of(flat: Floats) -> Floats:
    """(2,) centre c of the circle that fits points p (N, 2) by least squares of |p|^2 = 2 p . c + k."""
    matrix = np.column_stack([2.0 * flat, np.ones(len(flat))])
    return np.asarray(np.linalg.lstsq(matrix, (flat**2).sum(axis=1), rcond=None)[0][:2])


def centred(flat: Floats, height: float, measured: Floats, start: Floats) -> Floats:
    """(N,) deviations of the ranges about their least-squares circle, m.

    They are the measured ranges less |p - s| - o, with the centre s, in the plane, and the offset o that fit best.

    Parameters
    ----------
    flat, height
        (N, 2) the commanded path p along the axes of its plane, and the plane's height over the station, m.
    start
        (2,) first guess of s.
    """
    s = start.copy()
    for _ in range(STEPS):
        off = flat - s
        distance = np.sqrt((off**2).sum(axis=1) + height**2)
        J = np.column_stack([-off / distance[:, None], np.ones(len(flat))])
        left = measured - distance
        step = np.linalg.lstsq(J, left, rcond=None)[0]
        s = s + step[:2]
        if np.abs(step[:2]).max() < SMALLEST:
            break
    return np.asarray(left - J @ step)
