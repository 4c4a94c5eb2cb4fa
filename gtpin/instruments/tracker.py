"""Trackers: positions, and orientations, of a target in the instrument's frame."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from gtpin.data.instrument_tables import TrackerTable
from gtpin.data.names import ORIENTATION, POSITION
from gtpin.data.read_instruments import SIGMAS
from gtpin.instruments.frame_and_target import TURN, alignment, frame_and_target
from gtpin.instruments.instrument import Component, Unknown
from gtpin.instruments.targets import AXES, OfTargets, Targets
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, from_quaternions, left_jacobian, log, skew
from gtpin.typing import Floats

TURNS = ("rx", "ry", "rz")


class Tracker(OfTargets):
    """Position F p + f of a target p, and where measured its orientation F R M, in the instrument's frame.

    p and R: the target's position and the platform's orientation, base frame. F and f: the base frame's orientation and origin
    in the instrument's frame. M: the target's orientation on the platform. Cameras and motion capture are trackers too.

    Unknown, in brackets the standard deviation of the prior: the targets' points on the platform (``target_sigma``). For
    ``target = "free"``: these points (0.3 m) and M (2 rad), so that what the poses do not determine of them stays as declared;
    otherwise M is the identity. For ``frame = "free"``: F and f, without a prior.
    """

    kind, Table = "tracker", TrackerTable
    table: TrackerTable

    def _unknowns(self) -> Sequence[Unknown]:
        positions = tuple(Component(axis, "m") for axis in AXES)
        self.turned = "qw" in self.read.numbers and bool(np.isfinite(self.read.numbers["qw"]).all())
        # Orientations are shown where nothing else tells of them: for a lone tracker, which has no name.
        lone = not self.table.name
        turns = tuple(Component(axis, "rad", group=1, initial_sigma=5e-5, shown=lone) for axis in TURNS)
        self.components = positions + (turns if self.turned else ())
        free_target = self.table.target == "free"
        self.targets = Targets(self.table, self.read, free=free_target)
        # A free target's orientation on the platform is free as well, where orientations are read.
        self._mounts = list(self.table.fixed_targets) if free_target and self.turned else []
        mounts = [
            Unknown(f"{self.table.name}.target{f'[{target}]' if target else ''}.{axis}", "rad", 0.0, TURN)
            for target in self._mounts
            for axis in TURNS
        ]
        frame = [
            Unknown(f"{self.table.name}.frame.{axis}", "m" if axis in AXES else "rad", 0.0, np.inf)
            for axis in ((*AXES, *TURNS) if self.table.frame == "free" else ())
        ]
        return self._identified((*self.targets.unknowns, *mounts, *frame))

    @property
    def declared(self) -> tuple[float | None, ...]:
        """Declared sigma of the position, m, and of the orientation, rad, if that is measured; None: it is estimated."""
        both = (self.table.position_sigma or self.table.sigma, self.table.orientation_sigma)
        return both if self.turned else both[:1]

    @cached_property
    def positions(self) -> Floats:
        """(M, 3) what was read of the targets' positions, m."""
        return np.column_stack([self.read.numbers[name] for name in POSITION])

    @cached_property
    def rotations(self) -> Floats | None:
        """(M, 3, 3) what was read of their orientations; None where none was."""
        if not self.turned:
            return None
        return from_quaternions(np.column_stack([self.read.numbers[name] for name in ORIENTATION]))

    def row_sigmas(self) -> Floats | None:
        """(M, c) sigmas along the axes of the instrument's frame, m and rad, if the table has such columns; else None."""
        names = SIGMAS[: len(self.components)]
        if not all(name in self.read.numbers and np.isfinite(self.read.numbers[name]).all() for name in names):
            return None
        return np.column_stack([self.read.numbers[name] for name in names])

    def measured(self) -> Floats:
        """(M, c) measured positions, m, and zeros for the orientation: :meth:`predicted` has its residual."""
        return np.hstack([self.positions, np.zeros((len(self.positions), len(self.components) - 3))])

    def predicted(self, poses: Poses, u: Floats) -> Floats:
        """(M, c) in the instrument's frame: position, m, and rotation vector, rad, from measured to predicted orientation."""
        found = self.measured() - self.residual_at(poses, u)
        found[:, :3] = self._read_at(poses, u).T
        return found

    def residual_at(self, poses: Poses, u: Floats) -> Floats:
        seen = self._read_at(poses, u)
        if self.rotations is None:
            return self.positions - seen.T
        return Poses(self.positions, self.rotations).minus(seen)

    def orientations(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3, 3) orientations of the targets that would be read, instrument's frame."""
        return self._read_at(poses, u).R

    def _read_at(self, poses: Poses, u: Floats) -> Poses:
        """The poses of the targets in the instrument's frame."""
        t, mount, shift, turn = self._split(u)
        R = poses.R @ exp(mount.reshape(-1, 3))[self.targets.of] if len(mount) else poses.R
        seen = Poses(self.targets.positions(poses, t), R)
        return seen.moved(shift, exp(turn)) if self.table.frame == "free" else seen

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, 6) derivative, in the instrument's frame, by the TCP's position (m) and rotation vector (rad), base frame.

        For the orientation it is that at a residual of 0; residuals are small.
        """
        t, _, _, turn = self._split(u)
        F = exp(turn)
        moved = F @ self.targets.by_pose(poses, t)
        if not self.turned:
            return np.asarray(moved)
        turned = np.zeros((len(poses), 3, 6))
        turned[:, :, 3:] = F
        return np.concatenate([moved, turned], axis=1)

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, k) derivative by the targets, their orientations on the platform, and the frame; see :meth:`by_pose`."""
        t, mount, _, turn = self._split(u)
        F = exp(turn)
        found = np.zeros((len(poses), len(self.components), len(self._kept)))
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
            if self.turned:
                found[:, 3:, -3:] = turned
        return found[:, :, self._kept]

    def start(self, nominal: Poses) -> Floats:
        """(k,) first guess: a free frame, and free targets, by a fit of nominal and measured poses; all else 0."""
        u, free, shift, F = np.zeros(len(self._kept)), self.table.frame == "free", np.zeros(3), np.eye(3)
        if self.table.target == "free":
            shift, F = self._start_of_targets(nominal, u, free)
        elif free and len(self.positions):
            at = Poses(self.targets.positions(nominal, u[: self.targets.count]), nominal.R)
            shift, F = alignment(at, self.positions, self.rotations)
        if free:
            u[-6:-3], u[-3:] = shift, log(F[None])[0]
        return u[self._kept]

    def _start_of_targets(self, nominal: Poses, u: Floats, free: bool) -> tuple[Floats, Floats]:
        """Set the first guess of free targets in u; give that of the frame, which comes from the target with most rows."""
        k, shift, F = self.targets.count, np.zeros(3), np.eye(3)
        for i in np.argsort(-np.bincount(self.targets.of, minlength=len(self.targets.declared)), kind="stable"):
            rows = self.targets.of == i
            if not rows.any():
                continue
            T = (self.positions[rows] - shift) @ F
            R = None if self.rotations is None else F.T @ self.rotations[rows]
            place = frame_and_target(nominal[rows], T, R, free_frame=free)
            if free:
                shift, F, free = place.shift, place.turn, False
            u[3 * i : 3 * i + 3] = place.at - self.targets.declared[i]
            if self._mounts:
                u[k + 3 * i : k + 3 * i + 3] = log(place.mount[None])[0]
        return shift, F

    def _split(self, u: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        whole, k = self._whole(u), self.targets.count
        if self.table.frame == "free":
            return whole[:k], whole[k:-6], whole[-6:-3], whole[-3:]
        return whole[:k], whole[k:], np.zeros(3), np.zeros(3)
