"""A first guess of a robot's postures: polynomials of the passive coordinates over the commands' ranges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from math import comb

import numpy as np

from gtpin.kinematics.copies import copies
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Ints

MOST_TERMS = 120
"""Largest number of terms of a polynomial: more terms take more time than the Newton step that they save."""
NODES_PER_TERM = 3
USABLE = 0.02
"""Largest error at the nodes, m or rad, of a guess that is used. Assumed."""
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)
"""Bases: one for each coordinate."""


@dataclass(frozen=True)
class FirstGuess:
    """Polynomials of the velocities that lead from a posture to others in a unit of time.

    - ``robot``: the robot.
    - ``lower``, ``upper``: (n,) ends of the commands' ranges, m or rad.
    - ``exponents``: (terms, n) exponents of each term in commands scaled to [-1, 1], by ascending degree.
    - ``coefficients``: (terms, nv) coefficients of the velocities.
    - ``X``: (nq,) configuration from which they lead.
    - ``error``: largest error at the nodes of the fit, in numbers of a configuration: m, rad, or a part of a quaternion.
    """

    robot: Chain
    lower: Floats
    upper: Floats
    exponents: Ints
    coefficients: Floats
    X: Floats
    error: float

    @staticmethod
    def fit(robot: Chain, home: Floats, postures: Callable[[Floats], Floats]) -> FirstGuess | None:
        """Fit to the configurations (N, nq) that ``postures`` gives for commands (N, n), NaN where they can't be reached.

        None where a range has no limits, where too few nodes can be reached, or where the fit is too inaccurate.
        ``home``: (nq,) the configuration at home.
        """
        lower, upper = robot.lower, robot.upper
        if not (np.isfinite(lower).all() and np.isfinite(upper).all()) or len(lower) > len(PRIMES):
            return None
        n = len(lower)
        degree = max(d for d in range(1, 9) if comb(n + d, d) <= MOST_TERMS or d == 1)
        powers = [e for e in product(range(degree + 1), repeat=n) if sum(e) <= degree]
        exponents = np.array(sorted(powers, key=sum))
        uniform = halton(n, NODES_PER_TERM * len(exponents) + 1)[1:]
        x = -np.cos(np.pi * uniform)  # dense at the ends, where polynomials of high degree oscillate
        q = lower + (x + 1.0) / 2.0 * (upper - lower)
        X = postures(q)
        reached = np.isfinite(X[:, 0])
        x, q, X = x[reached], q[reached], X[reached]
        if len(x) < 2 * len(exponents):
            return None
        terms, targets = _terms(x, exponents).T, copies(robot).difference(home, X)
        coefficients = np.asarray(np.linalg.lstsq(terms, targets, rcond=None)[0], dtype=np.float64)
        guess = FirstGuess(robot, lower, upper, exponents, coefficients, home, 0.0)
        error = float(np.abs(guess(q) - X).max())
        return replace(guess, error=error) if error <= USABLE else None

    def __call__(self, q: Floats) -> Floats:
        """(N, nq) guessed configurations at commands q (N, n)."""
        x = (q - self.lower) / (self.upper - self.lower) * 2.0 - 1.0
        velocities = _terms(x, self.exponents).T @ self.coefficients
        return copies(self.robot).integrate(np.tile(self.X, (len(q), 1)), velocities)


def _terms(x: Floats, exponents: Ints) -> Floats:
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


def halton(coordinates: int, count: int) -> Floats:
    """(count, coordinates) first points of Halton's sequence in the unit cube, from the origin on; at most 16 coordinates."""
    points = np.zeros((count, coordinates))
    for base, x in zip(PRIMES[:coordinates], points.T, strict=True):
        left, place = np.arange(count), 1.0 / base
        while left.any():
            x += place * (left % base)
            left, place = left // base, place / base
    return points
