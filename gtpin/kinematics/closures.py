"""The rods' closures for many poses at once: residual, Jacobian, Newton's method with continuation, and a first guess."""

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

Rows = npt.NDArray[np.int_]

MAX_STEPS = 12
CONTRACTION = 0.25
"""As for the single posture: see :mod:`gtpin.kinematics.newton`."""
SMALLEST_STRIDE = 1.0 / 256.0
"""Smallest step as a fraction of the path; a pose that needs a smaller one is given up. Assumed."""
MOST_TERMS = 120
"""Largest number of terms of a polynomial: more terms take more time than the Newton step that they save."""
NODES_PER_TERM = 3
USABLE = 0.02
"""Largest error at the nodes, m or rad, of a guess that is used. Assumed."""
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)
"""Bases: one for each coordinate."""


@dataclass(frozen=True)
class RodEnds:
    """Ends and lengths of the rods at many poses.

    ``P``: joints on the platform, TCP frame, m: (k, 3), or (N, k, 3) where they differ from pose to pose. ``C``: (N, k, 3)
    joints on the carriers, base frame, m. ``L``: lengths, m: (N, k), or (1, k) where all poses have the same.
    """

    P: Floats
    C: Floats
    L: Floats

    def take(self, rows: Rows) -> RodEnds:
        """The ends at some of the poses."""
        P = self.P if self.P.ndim == 2 else self.P[rows]
        return RodEnds(P, self.C[rows], self.L if len(self.L) == 1 else self.L[rows])


def between(before: RodEnds, after: RodEnds, s: Floats, rows: Rows) -> RodEnds:
    """Rods at fractions s (m,) of the way from one set of ends to another, for the poses with the indices ``rows`` (m,)."""
    one, two = before.take(rows), after.take(rows)
    if (s == 1.0).all():
        return two
    w = s[:, None]
    P = one.P if one.P is two.P else one.P + w[..., None] * (two.P - one.P)
    return RodEnds(P, one.C + w[..., None] * (two.C - one.C), one.L + w * (two.L - one.L))


def rod_vectors(poses: Poses, ends: RodEnds) -> tuple[Floats, Floats]:
    """d = T + R P - C and R P, both (N, k, 3), base frame, m."""
    RP = ends.P @ np.swapaxes(poses.R, 1, 2)
    return RP + poses.T[:, None, :] - ends.C, RP


def pose_jacobian(d: Floats, RP: Floats) -> Floats:
    """(N, k, 6) derivative of the closures (|d|^2 - L^2) / 2 by the TCP's position and rotation vector, base frame."""
    jacobian = np.empty((*d.shape[:2], 6))
    jacobian[..., :3] = d
    # The cross product written out: numpy's own makes several passes over the whole array.
    jacobian[..., 3] = RP[..., 1] * d[..., 2] - RP[..., 2] * d[..., 1]
    jacobian[..., 4] = RP[..., 2] * d[..., 0] - RP[..., 0] * d[..., 2]
    jacobian[..., 5] = RP[..., 0] * d[..., 1] - RP[..., 1] * d[..., 0]
    return jacobian


def newton(start: Poses, ends: RodEnds, size: float) -> tuple[Poses, npt.NDArray[np.bool_]]:
    """Close the rods by Newton's method.

    ``start``: (N) poses to start from, base frame. ``ends``: the rods, as many as a pose has freedoms: six. ``size``:
    magnitude of the coordinates, m, for the size of rounding errors.

    Returns the last iterates, and (N,) whether they close to rounding errors and all steps contracted.
    """
    T, R = start.T.copy(), start.R.copy()
    closed = np.zeros(len(T), dtype=bool)
    rows = np.arange(len(T))
    last_step = np.full(len(T), np.inf)
    rounding = 16.0 * np.finfo(float).eps * size
    for step_number in range(MAX_STEPS + 1):
        whole = len(rows) == len(T)
        here = Poses(T, R) if whole else Poses(T[rows], R[rows])
        now = ends if whole else ends.take(rows)
        d, RP = rod_vectors(here, now)
        gap = (np.einsum("nki,nki->nk", d, d) - now.L**2) / 2.0
        done = np.abs(gap / now.L).max(axis=1) <= rounding
        if step_number == MAX_STEPS or done.all():
            closed[rows[done]] = True
            break
        if done.any():
            closed[rows[done]] = True
            rows, d, RP, gap, last_step = rows[~done], d[~done], RP[~done], gap[~done], last_step[~done]
        step = solve_each(pose_jacobian(d, RP), -gap)
        length = np.linalg.norm(step, axis=1)
        # Steps below the square root of rounding errors no longer shrink; there only the closure residual decides.
        good = (length <= 1e-8) | (length <= CONTRACTION * last_step)
        if not good.all():
            rows, step, length = rows[good], step[good], length[good]
        T[rows] += step[:, :3]
        R[rows] = exp(step[:, 3:]) @ R[rows]
        last_step = length
    return Poses(T, R), closed


def solve_each(matrices: Floats, right: Floats) -> Floats:
    """(N, k) solutions of N square systems (N, k, k), (N, k); NaN where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, right[..., None])[..., 0])
    except np.linalg.LinAlgError:  # numpy solves none of the systems if one is singular
        solution = np.full(right.shape, np.nan)
        regular = np.asarray(
            np.isfinite(matrices).all(axis=(1, 2))
        )  # matrix_rank fails for all of them where one number is not finite
        regular[regular] = np.linalg.matrix_rank(matrices[regular]) == matrices.shape[-1]
        solution[regular] = np.linalg.solve(matrices[regular], right[regular][..., None])[..., 0]
        return solution


def follow(path: Callable[[Floats, Rows], RodEnds], start: Poses, size: float) -> Poses:
    """Solve the closures at the end of a path, in the assembly mode of its beginning.

    Each pose follows the path in steps so short that Newton's method contracts: one step where that is possible. With several
    steps, the determinant of the closures' Jacobian must also keep its sign, which changes where assembly modes meet.

    ``path``: gives the rods at fractions s (m,) in [0, 1] of the way, for the poses with the indices (m,). ``start``: (N)
    closed poses at s = 0. ``size``: as for :func:`newton`.

    Returns (N) closed poses at s = 1; NaN where the closures have no solution on the path.
    """
    T, R = start.T.copy(), start.R.copy()
    done, stride = np.zeros(len(T)), np.ones(len(T))
    hesitant = np.zeros(len(T), dtype=bool)
    rows = np.arange(len(T))
    while rows.size:
        reach = np.minimum(1.0, done[rows] + stride[rows])
        ends = path(reach, rows)
        poses, closed = newton(Poses(T[rows], R[rows]), ends, size)
        doubtful = np.flatnonzero(closed & hesitant[rows])
        if doubtful.size:
            old = rows[doubtful]
            side = _side(start[old], path(np.zeros(len(old)), old))
            closed[doubtful] = _side(poses[doubtful], ends.take(doubtful)) == side
        hesitant[rows[~closed]] = True
        there = rows[closed]
        T[there], R[there] = poses.T[closed], poses.R[closed]
        done[there] = reach[closed]
        stride[there] *= 2.0
        stride[rows[~closed]] /= 2.0
        lost = stride < SMALLEST_STRIDE
        T[lost], R[lost] = np.nan, np.nan
        rows = np.flatnonzero((done < 1.0) & ~lost)
    return Poses(T, R)


def _side(poses: Poses, ends: RodEnds) -> Floats:
    """(N,) sign of the determinant of the closures' Jacobian by the pose."""
    return np.asarray(np.sign(np.linalg.det(pose_jacobian(*rod_vectors(poses, ends)))))


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
