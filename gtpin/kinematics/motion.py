"""First-order motion of TCP, measured links and joints by commands, and by twists of the robot's frames, at many postures."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from gtpin.kinematics.closing import Here, LoopClosure
from gtpin.kinematics.placed import Moves, PlacedParts, rotation, times
from gtpin.kinematics.rotations import skew
from gtpin.typing import Floats, Ints


class FrameMotion:
    """Motion by displaced frames, and by commands, at N postures whose loops stay closed.

    Frames and their indices are those of :mod:`~gtpin.robot.placement_frames`. Motions are of the TCP (position,
    m, rotation vector, rad; base frame), then rotation vectors, rad, of the robot's l measured links, base frame, then of the
    coordinates of its k measured joints (rad or m).

    With dx = -D^-1 b of the passive velocities, where b is the change of the closure equations, a twist moves the TCP by its
    own motion and by H b, H = -J_tcp D^-1.
    """

    def __init__(self, loops: LoopClosure, here: Here, placed: PlacedParts) -> None:
        self._loops, self._placed, self._oMi = loops, placed, here.oMi
        robot, n = loops.robot, len(here)
        self._J, self._placements = robot.model.njoints - 1, placed.placements
        tcp = here.oMi[:, robot.tcp_joint]
        self._R_tcp, self._T_tcp = times(tcp, placed.tcp)
        self._supports = [set(robot.model.supports[link.joint_id]) for link in robot.measured_links]
        each = [here.J[..., 3:] * np.isin(loops.joint_of, list(own))[:, None] for own in self._supports]
        J_tcp = np.swapaxes(np.concatenate([here.J * loops.tcp[:, None], *each], axis=2), 1, 2)
        if loops.follows:
            J_tcp = J_tcp @ loops.fold
        J_tcp[:, :3] -= skew(self._T_tcp) @ J_tcp[:, 3:6]
        driven = J_tcp[:, :, loops.driven]
        self._F, inverse = here.equations.F, here.inverse
        self._H = -J_tcp[:, :, loops.solved] @ inverse
        if robot.measured_joints:
            own = np.searchsorted(loops.solved, [joint.index_v for joint in robot.measured_joints])
            self._H = np.concatenate([self._H, -inverse[:, own]], axis=1)
            driven = np.concatenate([driven, np.zeros((n, len(own), driven.shape[2]))], axis=1)
        self.by_commands: Floats = driven + self._H @ loops.by_velocities(here, self._F, loops.driven)
        """(N, 6 + 3 l + k, n) motion by each command."""
        self._rows: dict[int, Floats] = {}

    def __len__(self) -> int:
        return len(self._oMi)

    def frame(self, index: int) -> tuple[Floats, Floats]:
        """Rotations (N, 3, 3) and origins (N, 3), m, of a frame in the base frame, before its own joint's motion."""
        if index == self._J:
            return self._R_tcp, self._T_tcp
        if index < self._J:
            return times(self._oMi[:, self._loops.parents[index + 1]], self._placements[..., index, :])
        anchor = index - self._J - 1
        carrier, at = self._oMi[:, self._loops.carriers[anchor]], self._placed.anchors[..., anchor, :, None]
        R = rotation(carrier)
        return R @ self._loops.robot.anchor_axes[anchor], (R @ at)[..., 0] + carrier[:, 9:]

    def by_twist(self, index: int, twist: Floats) -> Floats:
        """(N, 6 + 3 l + k, m) motion by twists (N, 6, m) or (6, m) of one frame, in its own axes."""
        return self._by_twists([(index, np.arange(twist.shape[-1]), twist)], twist.shape[-1])

    @cached_property
    def by_rod_lengths(self) -> Floats:
        """(N, 6 + 3 l + k, r) motion by the length of each of r rods."""
        rods = self._loops.robot.longer_rods
        return self._by_twists(
            [(frame, np.array([i]), along[:, None]) for i, (frame, along) in enumerate(rods)], len(rods)
        )

    def by_parameters(self, moves: Moves, count: int, q: Floats) -> Floats:
        """(N, 6 + 3 l + k, count) motion by the parameters of a geometry, at commands q (N, n)."""
        found = self._by_twists(moves.frames, count)
        for column, actuator in moves.scales:
            found[:, :, column] += self.by_commands[:, :, actuator] * q[:, actuator, None]
        return found

    def _by_twists(self, frames: Sequence[tuple[int, Ints, Floats]], count: int) -> Floats:
        """(N, 6 + 3 l + k, count) motion by twists of frames; see :class:`~gtpin.kinematics.placed.Moves`."""
        loops, J = self._loops, self._J
        b = np.zeros((len(self), len(loops.loop_of), count))
        for index, columns, twists in frames:
            signs = self._signs(index)
            if signs.any():
                some, changed = _slice(columns), self._change(index, twists, signs)
                for place, e in enumerate(np.flatnonzero(signs)):
                    b[:, e, some] += changed[:, place]
        found = self._H @ b
        for index, columns, twists in frames:
            if index == J or (index < J and loops.moves_tcp[index + 1]):
                found[:, :6, columns] += self._carried(index) @ twists
            for i, own in enumerate(self._supports):
                if index < J and index + 1 in own:
                    found[:, 6 + 3 * i : 9 + 3 * i, columns] += self.frame(index)[0] @ twists[..., 3:, :]
        return np.asarray(found)

    def _carried(self, index: int) -> Floats:
        """(N, 6, 6) motion of the TCP by twists of a frame that carries it."""
        R, T = self.frame(index)
        moved = np.zeros((len(self), 6, 6))
        moved[:, :3, :3] = moved[:, 3:, 3:] = R
        if index != self._J:
            moved[:, :3, 3:] = -skew(self._T_tcp - T) @ R
        return moved

    def _signs(self, index: int) -> Floats:
        """(E,) the S of a frame for each equation."""
        loops, anchor = self._loops, index - self._J - 1
        if index == self._J:
            return np.zeros(len(loops.loop_of))
        if anchor < 0:
            return np.asarray(loops.signs[loops.loop_of, index + 1])
        return np.where(loops.loop_of == anchor // 2, 1.0 if anchor % 2 else -1.0, 0.0)

    def _change(self, index: int, twist: Floats, signs: Floats) -> Floats:
        """(N, c, m) change of the equations whose sign is not zero by twists (N, 6, m) or (6, m) of a frame."""
        if index not in self._rows:
            some, (R, T) = np.flatnonzero(signs), self.frame(index)
            F = self._F[:, some] * signs[some, None]
            turns = F[:, :, 3:] - np.cross(T[:, None], F[:, :, :3])
            if index > self._J:  # the rotation of an anchor moves nothing
                turns = np.zeros_like(turns)
            self._rows[index] = np.concatenate([F[:, :, :3] @ R, turns @ R], axis=2)
        return np.asarray(self._rows[index] @ twist)


def _slice(columns: Ints) -> slice | Ints:
    """Columns that follow each other as a slice, which NumPy takes without a copy."""
    first, last = int(columns[0]), int(columns[-1])
    return slice(first, last + 1) if np.array_equal(columns, np.arange(first, last + 1)) else columns
