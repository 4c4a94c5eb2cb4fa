"""Other readings of commands: q is read as A q + z.

A has signs, units, orders and couplings of columns; z has zeros of drives. They are fitted with the instrument frame (F, f) and
the target's place t and rotation X, where these are free. Measured are the positions F (p + R t) + f and the rotations F R X,
with p and R the nominal TCP's at A q + z.

For given A and z the frame follows in closed form (Kabsch 1976), and t as the mean of R' (F' (T - f) - p), in alternation.
The zeros of joints that turn start from a grid over the whole turn. The best starts are refined by Gauss-Newton steps in z
alone, of the residuals after frame and target (variable projection, Golub and Pereyra 1973).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from gtpin.calibration.checks import limits
from gtpin.calibration.checks.readings import CommandReading
from gtpin.calibration.problem import Measured
from gtpin.instruments.frame_and_target import nearest
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.rotations import log
from gtpin.typing import Floats


@dataclass(frozen=True)
class CommandSearch:
    """Fits zeros, with the frame and the target where these are free, to measured poses.

    ``size``: size of the workspace, m: angles times this are compared with lengths. ``at``: (3,) place of the target, TCP
    frame, m; of a free target the first guess.
    """

    kinematics: Kinematics
    measured: Measured
    size: float
    free_frame: bool
    free_target: bool
    at: Floats

    def found(self, readings: Iterable[CommandReading]) -> Iterator[tuple[float, CommandReading, Floats]]:
        """The readings that come nearest to the measured poses: misfit, m, reading, and zeros z (n,), m or rad."""
        starts = [(reading, z) for reading in readings for z in self._grid(reading)]
        if not starts:  # several mistakes of one drive
            return
        some, zeros = [reading for reading, _ in starts], np.stack([z for _, z in starts])
        few = self._few(30)
        misfits = _misfits(self._residuals(few, np.stack([reading.matrix for reading in some]), zeros, 3))
        for rows, keep, steps, rounds in ((few, 300, 3, 3), (self._few(50), 40, 8, 10)):
            best = [k for k in np.argsort(misfits)[:keep] if np.isfinite(misfits[k])]
            if not best:
                return
            some = [some[k] for k in best]
            misfits, zeros = self._refined(some, zeros[best], rows, steps, rounds)
        named = set[int]()
        for k in np.argsort(misfits):  # of each reading the best start
            if id(some[k]) not in named:
                named.add(id(some[k]))
                yield float(misfits[k]), some[k], zeros[k]

    def _grid(self, reading: CommandReading) -> Iterator[Floats]:
        revolute = self.kinematics.robot.revolute
        # With loops, from another home only: their poses take longer.
        several = not self.kinematics.loops.count or (reading.matrix == np.eye(len(revolute))).all()
        # Half a step is 22 degrees, from which the Gauss-Newton steps converge.
        grids = [2.0 * np.pi * np.arange(8) / 8.0 if several and revolute[j] else np.zeros(1) for j in reading.zeros]
        for values in product(*grids):
            z = np.zeros(len(revolute))
            z[list(reading.zeros)] = values
            yield z

    def _few(self, count: int) -> Measured:
        """Some of the rows."""
        rows = len(self.measured.T)
        return self.measured.take(np.linspace(0, rows - 1, min(rows, count)).astype(int))

    def _residuals(self, measured: Measured, matrices: Floats, zeros: Floats, rounds: int) -> Floats:
        """(K, N, c) measured less predicted poses with K readings of the commands, m; NaN where one can't be reached.

        ``rounds``: number of alternating fits of frame and target, each with new weights of the rows.
        """
        T, R = measured.T, measured.R
        q = measured.q @ np.swapaxes(matrices, 1, 2) + zeros[:, None]
        poses = self.kinematics.forward(q.reshape(-1, q.shape[2]))
        p, turned = poses.T.reshape(len(q), -1, 3), poses.R.reshape(len(q), -1, 3, 3)
        reached = np.isfinite(p[..., 0])
        good = reached.mean(axis=1) > limits.REACHED
        reached = reached[good]
        p, turned = np.nan_to_num(p[good]), np.where(reached[..., None, None], turned[good], np.eye(3))
        far = np.linalg.norm(T - np.median(T, axis=0), axis=1)
        weight = (reached & (far <= 10.0 * np.median(far)))[..., None].astype(float)
        F, f, t = np.broadcast_to(np.eye(3), (len(p), 3, 3)), np.zeros((len(p), 1, 3)), np.tile(self.at, (len(p), 1, 1))
        for _ in range(rounds):
            weight = weight / weight.sum(axis=1, keepdims=True)
            at = p + (turned @ t[..., None])[..., 0]
            if self.free_frame:
                middle, seen = (weight * at).sum(axis=1, keepdims=True), (weight * T).sum(axis=1, keepdims=True)
                F = nearest(np.swapaxes(weight * (T - seen), 1, 2) @ (at - middle))
                f = seen - middle @ np.swapaxes(F, 1, 2)
            if self.free_target:
                aside = (np.swapaxes(turned, 2, 3) @ ((T - f) @ F - p)[..., None])[..., 0]
                t = (weight * aside).sum(axis=1, keepdims=True)
                at = p + (turned @ t[..., None])[..., 0]
            r = T - f - at @ np.swapaxes(F, 1, 2)
            off = np.linalg.norm(r, axis=2, keepdims=True)
            off = np.where(reached[..., None], off, np.nan)
            middle = np.maximum(np.nanmedian(off, axis=1, keepdims=True), 1e-9)
            weight = np.nan_to_num(1.0 / np.maximum(off / middle, 1.0))
        if R is not None:
            seen = F[:, None] @ turned
            X = nearest((np.swapaxes(seen, 2, 3) @ R).sum(axis=1))[:, None] if self.free_target else np.eye(3)
            r = np.concatenate([r, self.size * log(R @ np.swapaxes(seen @ X, 2, 3))], axis=2)
        found = np.full((len(q), *r.shape[1:]), np.nan)
        found[good] = np.where(reached[..., None], r, np.nan)
        return found

    def _refined(
        self, readings: Sequence[CommandReading], z: Floats, measured: Measured, steps: int, rounds: int
    ) -> tuple[Floats, Floats]:
        """(K,) the smallest misfit, m, on the way of Gauss-Newton steps from zeros z (K, n), and (K, n) its zeros."""
        matrices = np.stack([reading.matrix for reading in readings])
        ways = np.zeros((max(len(reading.zeros) for reading in readings), *z.shape))
        for i, reading in enumerate(readings):
            for k, j in enumerate(reading.zeros):
                ways[k, i, j] = 1.0
        best, least = z, np.full(len(z), np.inf)
        for _ in range(steps):
            r = self._residuals(measured, matrices, z, rounds)
            misfit = _misfits(r)
            better = misfit < least
            best, least = np.where(better[:, None], z, best), np.where(better, misfit, least)
            changes = [self._residuals(measured, matrices, z + 1e-5 * way, rounds) - r for way in ways]  # m or rad
            if not changes:  # no zeros
                break
            off = np.linalg.norm(r, axis=2, keepdims=True)
            weight = np.sqrt(1.0 / np.maximum(off / np.maximum(misfit[:, None, None], 1e-9), 1.0))
            J = np.nan_to_num(np.stack(changes, axis=3) * weight[..., None]).reshape(len(z), -1, len(ways))
            y = np.nan_to_num(r * weight).reshape(len(z), -1, 1)
            normal = np.swapaxes(J, 1, 2) @ J
            normal += (1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-30) * np.eye(len(ways))
            z = z - 1e-5 * np.einsum("kin,ik->in", ways, np.linalg.solve(normal, np.swapaxes(J, 1, 2) @ y)[:, :, 0])
        turns = 2.0 * np.pi * np.round(best / (2.0 * np.pi))
        return least, np.where(self.kinematics.robot.revolute, best - turns, best)


def _misfits(residuals: Floats) -> Floats:
    """(K,) median length of residuals (K, N, c), m; infinite without any."""
    off = np.linalg.norm(residuals, axis=2)
    none = np.isnan(off).all(axis=1)
    return np.where(none, np.inf, np.nanmedian(np.where(none[:, None], 0.0, off), axis=1))
