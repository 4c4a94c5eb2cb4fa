"""Trackers: positions, and orientations, of a target in the instrument's frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gtpin.data.instrument_tables import TrackerTable
from gtpin.data.names import ORIENTATION, POSITION
from gtpin.data.read_instruments import SIGMAS
from gtpin.instruments.instrument import Component, Instrument, Unknown
from gtpin.instruments.targets import AXES, Targets
from gtpin.kinematics.alignment import alignment
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, from_quaternions, left_jacobian, log, skew

Floats = npt.NDArray[np.float64]

TURNS = ("rx", "ry", "rz")


class Tracker(Instrument):
    """Position F p + f of a target p, and the orientation F R of the platform, in the instrument's frame (F, f).

    A camera or motion capture is one with its own sigmas. Unknown: the frame if it is free, with no prior; targets.
    """

    kind, Table = "tracker", TrackerTable
    table: TrackerTable

    def _unknowns(self) -> Sequence[Unknown]:
        positions = tuple(Component(axis, "m") for axis in AXES)
        self.turned = "qw" in self.read.numbers and bool(np.isfinite(self.read.numbers["qw"]).all())
        turns = tuple(Component(axis, "rad", group=1, usual=5e-5, shown=False) for axis in TURNS)
        self.components = positions + (turns if self.turned else ())
        self._T = np.column_stack([self.read.numbers[name] for name in POSITION])
        self._R = (
            from_quaternions(np.column_stack([self.read.numbers[name] for name in ORIENTATION]))
            if self.turned
            else None
        )
        free_target = self.table.target == "free"
        self.targets = Targets(self.table, self.read, free=free_target)
        # A free target's orientation on the platform is free as well, where orientations are read.
        self._mounts = list(self.table.fixed_targets) if free_target and self.turned else []
        mounts = [
            Unknown(f"{self.table.name}.target{f'[{target}]' if target else ''}.{axis}", "rad", 0.0, np.inf)
            for target in self._mounts
            for axis in TURNS
        ]
        frame = [
            Unknown(f"{self.table.name}.frame.{axis}", "m" if axis in AXES else "rad", 0.0, np.inf)
            for axis in ((*AXES, *TURNS) if self.table.frame == "free" else ())
        ]
        return (*self.targets.unknowns, *mounts, *frame)

    @property
    def declared(self) -> tuple[float | None, ...]:
        """Declared sigmas of the position and of the orientation."""
        both = (self.table.position_sigma or self.table.sigma, self.table.orientation_sigma)
        return both if self.turned else both[:1]

    def row_sigmas(self) -> Floats | None:
        """(M, c) sigmas along the instrument's own axes, where the table has them."""
        names = SIGMAS[: len(self.components)]
        if not all(name in self.read.numbers and np.isfinite(self.read.numbers[name]).all() for name in names):
            return None
        return np.column_stack([self.read.numbers[name] for name in names])

    def measured(self) -> Floats:
        """(M, c) positions, m; the orientation is in :meth:`minus`."""
        return np.hstack([self._T, np.zeros((len(self._T), len(self.components) - 3))])

    def predicted(self, poses: Poses, u: Floats) -> Floats:
        """(M, c) position, m, and the rotation vector, rad, of the predicted less the measured orientation."""
        t, mount, shift, turn = self._split(u)
        F = exp(turn)
        positions = self.targets.positions(poses, t) @ F.T + shift
        if self._R is None:
            return np.asarray(positions)
        R = F @ poses.R @ self._mounted(mount)
        return np.hstack([positions, -log(self._R @ np.swapaxes(R, 1, 2))])

    def orientations(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3, 3) orientations that would be read, instrument's frame."""
        _, mount, _, turn = self._split(u)
        return np.asarray(exp(turn) @ poses.R @ self._mounted(mount))

    def looked_at(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3) the targets, base frame, m."""
        return self.targets.positions(poses, u[: self.targets.count])

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, 6) derivative by the platform's motion, turned to the instrument's frame."""
        t, _, _, turn = self._split(u)
        F = exp(turn)
        moved = F @ self.targets.by_pose(poses, t)
        if self._R is None:
            return np.asarray(moved)
        turned = np.zeros((len(poses), 3, 6))
        turned[:, :, 3:] = F
        return np.concatenate([moved, turned], axis=1)

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, k) by targets, their orientations, and the frame."""
        t, mount, _, turn = self._split(u)
        F = exp(turn)
        found = np.zeros((len(poses), len(self.components), len(u)))
        k = self.targets.count
        found[:, :3, :k] = F @ self.targets.by_unknown(poses)
        if len(mount):
            for i in range(len(self._mounts)):
                rows = self.targets.of == i
                own = slice(k + 3 * i, k + 3 * i + 3)
                found[rows, 3:, own] = F @ poses.R[rows] @ left_jacobian(mount[3 * i : 3 * i + 3])
        if self.table.frame == "free":
            turned = left_jacobian(turn)
            found[:, :3, -6:-3] = np.eye(3)
            found[:, :3, -3:] = -skew(self.targets.positions(poses, t) @ F.T) @ turned
            if self._R is not None:
                found[:, 3:, -3:] = turned
        return found

    def start(self, nominal: Poses) -> Floats:
        """(k,) the frame by the best fit of nominal and measured poses; zeros where it is the base frame."""
        u = np.zeros(len(self.unknowns))
        if self.table.frame == "free":
            at = Poses(self.targets.positions(nominal, u[: self.targets.count]), nominal.R)
            R_measured = None if self._R is None or self._mounts else self._R
            shift, F = alignment(at, self._T, R_measured)
            u[-6:-3], u[-3:] = shift, log(F[None])[0]
        return u

    def _mounted(self, mount: Floats) -> Floats:
        """(M, 3, 3) orientation of each row's target on the platform."""
        if not len(mount):
            return np.broadcast_to(np.eye(3), (self.read.count, 3, 3))
        return np.asarray(exp(mount.reshape(-1, 3))[self.targets.of])

    def _split(self, u: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        k = self.targets.count
        if self.table.frame == "free":
            return u[:k], u[k:-6], u[-6:-3], u[-3:]
        return u[:k], u[k:], np.zeros(3), np.zeros(3)
