"""Rods between a platform and its carriers: their closures |T + R P - C| = L, solved by Newton's method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rotations import exp
from gtpin.typing import Floats

Rows = npt.NDArray[np.int_]
Bools = npt.NDArray[np.bool_]

STEPS = 12
SHORTER = 0.25
"""Largest ratio of each Newton step to the one before; with a larger one the start was not near the solution."""
FINE = 1e-8
"""Step, m or rad, below which this ratio is not checked, because rounding errors dominate it."""
SHORTEST = 1.0 / 256.0
"""Smallest stride, as a share of the path to new ends. Where shorter ones are needed, the ends can't be reached."""


@dataclass(frozen=True)
class RodEnds:
    """Ends of the rods at N poses: P on the platform, (k, 3) or (N, k, 3), TCP frame; C (N, k, 3) on the carriers, base
    frame; lengths L (N, k) or (1, k); all in m.
    """

    P: Floats
    C: Floats
    L: Floats

    def take(self, rows: Rows | Bools) -> RodEnds:
        """The ends at some of the poses."""
        return RodEnds(
            self.P if self.P.ndim == 2 else self.P[rows], self.C[rows], self.L if len(self.L) == 1 else self.L[rows]
        )

    def rods(self, poses: Poses) -> tuple[Floats, Floats]:
        """Vectors from each rod's carrier joint, and from the TCP, to its platform joint: both (N, k, 3), base frame, m."""
        arm = self.P @ np.swapaxes(poses.R, 1, 2)
        return poses.T[:, None] + arm - self.C, arm

    def gaps(self, poses: Poses) -> Floats:
        """(N, k) distance of each rod's joints less its length, m."""
        return np.asarray(np.linalg.norm(self.rods(poses)[0], axis=2) - self.L)

    def squares(self, poses: Poses) -> Floats:
        """(N, k) half the difference of the squares of that distance and the rod's length, m^2."""
        rods = self.rods(poses)[0]
        return np.asarray((np.einsum("nki,nki->nk", rods, rods) - self.L**2) / 2.0)


def by_pose(rods: Floats, arm: Floats) -> Floats:
    """(N, k, 6) derivative of the gaps by the platform's position and rotation vector, base frame.

    A row is the wrench on the platform, at the TCP, of a unit force along the rod.
    """
    unit = rods / np.linalg.norm(rods, axis=2, keepdims=True)
    return np.concatenate([unit, np.cross(arm, unit)], axis=2)


def each_solved(matrices: Floats, right: Floats) -> Floats:
    """(N, k) solutions of N systems (N, k, k), (N, k); NaN where one is singular."""
    singular = ~(np.abs(np.linalg.det(matrices)) > 0.0)
    safe = np.where(singular[:, None, None], np.eye(matrices.shape[1]), matrices)
    solution = np.linalg.solve(safe, right[..., None])[..., 0]
    solution[singular] = np.nan
    return np.asarray(solution)


def closed(start: Poses, ends: RodEnds, size: float) -> tuple[Poses, Bools]:
    """Poses (N) at which the rods close, from nearby poses, and (N,) whether they close to the rounding error of ``size``,
    m."""
    T, R = start.T.copy(), start.R.copy()
    done = np.zeros(len(T), dtype=bool)
    before = np.full(len(T), np.inf)
    rows = np.arange(len(T))
    for _ in range(STEPS):
        some, here = ends.take(rows), Poses(T[rows], R[rows])
        gaps = some.gaps(here)
        done[rows] = np.abs(gaps).max(axis=1) <= 16.0 * np.finfo(float).eps * size
        step = each_solved(by_pose(*some.rods(here)), -gaps)
        length = np.linalg.norm(step, axis=1)
        going = ~done[rows] & ((length <= FINE) | (length <= SHORTER * before[rows]))  # NaN does not go on
        rows, step, length = rows[going], step[going], length[going]
        if not rows.size:
            break
        T[rows] += step[:, :3]
        R[rows] = exp(step[:, 3:]) @ R[rows]
        before[rows] = length
    return Poses(T, R), done


def led(way: Callable[[Floats, Rows], RodEnds], start: Poses, size: float) -> Poses:
    """Closed poses (N) at the end of a path of the rods' ends, from the closed poses ``start``, in the same assembly mode.

    ``way`` gives the ends at fractions (m,) of the path, for m of the poses. A stride along the path is halved until Newton's
    method converges fast to the next pose without crossing a singularity; NaN where the stride becomes too short.
    """
    T, R = start.T.copy(), start.R.copy()
    at, stride = np.zeros(len(T)), np.ones(len(T))
    rows = np.arange(len(T))
    side = _side(way(at, rows), start)
    while rows.size:
        goal = np.minimum(1.0, at[rows] + stride[rows])
        ends = way(goal, rows)
        poses, good = closed(Poses(T[rows], R[rows]), ends, size)
        good[good] = _side(ends.take(good), poses[good]) == side[rows[good]]
        on, off = rows[good], rows[~good]
        T[on], R[on], at[on] = poses.T[good], poses.R[good], goal[good]
        stride[on] *= 2.0
        stride[off] /= 2.0
        lost = off[stride[off] < SHORTEST]
        T[lost], R[lost], at[lost] = np.nan, np.nan, 1.0
        rows = np.flatnonzero(at < 1.0)
    return Poses(T, R)


def _side(ends: RodEnds, poses: Poses) -> Floats:
    return np.asarray(np.sign(np.linalg.det(by_pose(*ends.rods(poses)))))
