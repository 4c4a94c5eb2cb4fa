"""A first guess of many poses at once: polynomials in the commands, fitted to closed postures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from math import comb

import numpy as np
import numpy.typing as npt

from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, log
from gtpin.typing import Floats

MOST_TERMS = 120
"""Largest number of terms of a polynomial: more terms take more time than the Newton step that they save."""
NODES_PER_TERM = 3
USABLE = 0.02
"""Largest error at the nodes, m or rad, of a guess that is used. Assumed."""
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)
"""Bases: one for each coordinate."""


@dataclass(frozen=True)
class FirstGuess:
    """Polynomials of position and rotation vector over the commands' ranges.

    - ``lower``, ``upper``: (n,) ends of the commands' ranges, m or rad.
    - ``exponents``: (terms, n) exponents of each term in commands scaled to [-1, 1], by ascending degree.
    - ``coefficients``: (terms, 6) coefficients of position, m, and rotation vector, rad.
    - ``R``: (3, 3) reference rotation: a rotation vector w means the rotation exp(w) R.
    - ``error``: largest error at the nodes of the fit, m or rad.
    """

    lower: Floats
    upper: Floats
    exponents: npt.NDArray[np.int_]
    coefficients: Floats
    R: Floats
    error: float

    @staticmethod
    def fit(lower: Floats, upper: Floats, solve: Callable[[Floats], Poses], R: Floats) -> FirstGuess | None:
        """Fit to poses at nodes, which ``solve`` computes from commands (N, n); R: the reference rotation (3, 3).

        None where a range has no limits, where too few nodes can be reached, or where the fit is too inaccurate.
        """
        if not (np.isfinite(lower).all() and np.isfinite(upper).all()):
            return None
        n = len(lower)
        degree = max(d for d in range(1, 9) if comb(n + d, d) <= MOST_TERMS or d == 1)
        powers = [e for e in product(range(degree + 1), repeat=n) if sum(e) <= degree]
        exponents = np.array(sorted(powers, key=sum))
        uniform = halton(n, NODES_PER_TERM * len(exponents) + 1)[1:]
        x = -np.cos(np.pi * uniform)  # dense at the ends, where polynomials of high degree oscillate
        poses = solve(lower + (x + 1.0) / 2.0 * (upper - lower))
        if poses.reached.sum() < 2 * len(exponents):
            return None
        x, poses = x[poses.reached], poses[poses.reached]
        targets = np.hstack([poses.T, log(poses.R @ R.T)])
        terms = _terms(x, exponents).T
        coefficients = np.asarray(np.linalg.lstsq(terms, targets, rcond=None)[0], dtype=np.float64)
        error = float(np.abs(terms @ coefficients - targets).max())
        return FirstGuess(lower, upper, exponents, coefficients, R, error) if error <= USABLE else None

    def __call__(self, q: Floats) -> Poses:
        """Guessed poses at commands q (N, n)."""
        x = (q - self.lower) / (self.upper - self.lower) * 2.0 - 1.0
        guess = _terms(x, self.exponents).T @ self.coefficients
        return Poses(np.ascontiguousarray(guess[:, :3]), exp(guess[:, 3:]) @ self.R)


def _terms(x: Floats, exponents: npt.NDArray[np.int_]) -> Floats:
    """(terms, N) products of powers of scaled commands (N, n): each is an earlier one times one command."""
    place = {tuple(e): i for i, e in enumerate(exponents.tolist())}
    factors = np.ascontiguousarray(x.T)
    terms = np.ones((len(exponents), len(x)))
    for i, exponent in enumerate(exponents.tolist()):
        if any(exponent):
            last = next(j for j, e in enumerate(exponent) if e)
            exponent[last] -= 1
            np.multiply(terms[place[tuple(exponent)]], factors[last], out=terms[i])
    return terms


def halton(coordinates: int, count: int) -> npt.NDArray[np.float64]:
    """(count, coordinates) first points of Halton's sequence in the unit cube, from the origin on; at most 16 coordinates."""
    points = np.zeros((count, coordinates))
    for base, x in zip(PRIMES[:coordinates], points.T, strict=True):
        left, place = np.arange(count), 1.0 / base
        while left.any():
            x += place * (left % base)
            left, place = left // base, place / base
    return points
