"""Points of low discrepancy: Halton's sequence without `scipy.stats`, whose import takes longer than the rest of the work."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)
"""Bases: one for each coordinate."""


def halton(coordinates: int, count: int) -> npt.NDArray[np.float64]:
    """(count, coordinates) first points of Halton's sequence in the unit cube, from the origin on; at most 16 coordinates."""
    points = np.zeros((count, coordinates))
    for base, x in zip(PRIMES[:coordinates], points.T, strict=True):
        left, place = np.arange(count), 1.0 / base
        while left.any():
            x += place * (left % base)
            left, place = left // base, place / base
    return points
