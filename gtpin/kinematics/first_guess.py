"""A first guess of a robot's postures: polynomials of the passive coordinates over the commands' ranges, or a part of them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import comb

import numpy as np
import pinocchio as pin

from gtpin.kinematics.copies import copies
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Ints

MOST_TERMS = 240
"""Largest number of terms of a polynomial: more terms take more time than the Newton step that they save."""
NODES_PER_TERM, FEWEST = 3, 1.5
"""Nodes of a fit by term, and those of them that must be reached at least."""
MOST_HALVINGS = 6
"""Smaller parts of the ranges need no fit of their own: over 1/64 of them a polynomial is exact but for rounding."""
MARGIN = 5.0
"""Smallest regularity on the way from home at which a guess tells the assembly mode, in RMS errors of the fit. Assumed."""
ON_THE_WAY = np.linspace(0.1, 0.9, 9)
"""Fractions of the way at which it is computed. At the end the closed posture itself has it."""
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)
"""Bases: one for each coordinate."""


@dataclass(frozen=True)
class FirstGuess:
    """Polynomials of the velocities that lead from home to other postures in a unit of time, and of their regularity.

    The *regularity* of a posture is the square of the ratio of its closures' determinant to that of home. Where two assembly
    modes meet it falls to zero along a line of commands, and it is smooth there, as the postures are not.

    - ``robot``: the robot.
    - ``lower``, ``upper``: (n,) ends of the commands for which it is, m or rad.
    - ``exponents``: (terms, n) exponents of each term in commands from home, as parts of :attr:`reach`, by ascending degree.
    - ``coefficients``: (terms, nv) coefficients of the velocities.
    - ``regularity``: (terms,) coefficients of the regularity.
    - ``margin``: the regularity from which on a guess tells the assembly mode.
    - ``X``: (nq,) configuration at home.
    """

    robot: Chain
    lower: Floats
    upper: Floats
    exponents: Ints
    coefficients: Floats
    regularity: Floats
    margin: float
    X: Floats

    @property
    def reach(self) -> Floats:
        """(n,) half of their ranges, m or rad."""
        return (self.upper - self.lower) / 2.0

    @staticmethod
    def fit(robot: Chain, nodes: Nodes, home: Floats, X: Floats, regularity: Floats) -> FirstGuess | None:
        """Fit to the configurations X (N, nq), NaN where they were not reached, and regularities (N,) at :func:`nodes`.

        None where too few were reached. ``home``: (nq,) the configuration at home.
        """
        lower, upper, exponents, q = nodes
        reached = np.isfinite(X[:, 0])
        if reached.sum() < FEWEST * len(exponents):
            return None
        reach, regularity = (upper - lower) / 2.0, regularity[reached]
        terms = _terms((q[reached] - robot.home_q) / reach, exponents).T
        of_regularity = np.asarray(np.linalg.lstsq(terms, regularity, rcond=None)[0])
        margin = MARGIN * float(np.sqrt(np.mean((terms @ of_regularity - regularity) ** 2)))
        targets = np.array([pin.difference(robot.model, home, x) for x in X[reached]])
        weights = np.clip(regularity, 0.0, 1.0)[:, None]
        coefficients = np.asarray(np.linalg.lstsq(weights * terms, weights * targets, rcond=None)[0])
        return FirstGuess(robot, lower, upper, exponents, coefficients, of_regularity, margin, home)

    def __call__(self, q: Floats) -> tuple[Floats, Floats]:
        """(N, nq) guessed configurations, and the fractions (N,) of the straight lines from home to commands q (N, n) at which
        they are. A posture near its guess is in the assembly mode of home.

        The fraction is 1 but where the line comes near a singularity; 0 outside ``lower`` and ``upper``.
        """
        terms = _terms((q - self.robot.home_q) / self.reach, self.exponents)
        degrees = self.exponents.sum(axis=1)[:, None]
        regular = (ON_THE_WAY**degrees * self.regularity[:, None]).T @ terms >= self.margin
        inside = ((q >= self.lower) & (q <= self.upper)).all(axis=1)
        s = np.array([0.0, *ON_THE_WAY[:-1], 1.0])[np.logical_and.accumulate(regular & inside).sum(axis=0)]
        V, short = terms.T @ self.coefficients, np.flatnonzero(s < 1.0)
        V[short] = (terms[:, short] * s[short] ** degrees).T @ self.coefficients
        return copies(self.robot).integrate(np.tile(self.X, (len(q), 1)), V), s


Nodes = tuple[Floats, Floats, Ints, Floats]
"""Lower and upper ends (n,) of commands, exponents (terms, n) of polynomials over these, and commands (N, n) for their fit."""


def halvings(robot: Chain, q: Floats) -> int:
    """How often the ranges of the commands, about home, can be halved and still contain the commands q (N, n)."""
    far = np.nanmax(np.abs(q - robot.home_q) / _span(robot), initial=0.5**MOST_HALVINGS)
    return int(max(0.0, -np.log2(far)))


def nodes(robot: Chain, halved: int) -> Nodes | None:
    """For polynomials over the ranges of a robot, halved so often about home; None where a range has no limits."""
    n, lower, upper = robot.n_actuators, robot.lower, robot.upper
    if not np.isfinite(upper - lower).all() or n > len(PRIMES):
        return None
    if halved:
        part = _span(robot) / 2.0**halved
        lower, upper = robot.home_q - part, robot.home_q + part
    degree = max(d for d in range(1, 10) if comb(n + d, d) <= MOST_TERMS or d == 1)
    powers = [e for e in product(range(degree + 1), repeat=n) if sum(e) <= degree]
    exponents = np.array(sorted(powers, key=sum))
    return lower, upper, exponents, lower + (upper - lower) * halton(n, NODES_PER_TERM * len(exponents) + 1)[1:]


def _span(robot: Chain) -> Floats:
    """(n,) distances of home from the farther ends of the commands' ranges, m or rad."""
    return np.maximum(robot.upper - robot.home_q, robot.home_q - robot.lower)


def _terms(x: Floats, exponents: Ints) -> Floats:
    """(terms, N) products of powers of scaled commands (N, n): each is an earlier one times one command."""
    place = {tuple(e): i for i, e in enumerate(exponents.tolist())}
    first = (exponents > 0).argmax(axis=1)
    earlier = (exponents - np.eye(x.shape[1], dtype=int)[first]).tolist()
    factors, terms = np.ascontiguousarray(x.T), np.ones((len(exponents), len(x)))
    for i, factor in enumerate(first[1:].tolist(), 1):
        np.multiply(terms[place[tuple(earlier[i])]], factors[factor], out=terms[i])
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
