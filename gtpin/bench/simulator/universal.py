"""The universal joint between a rod and the platform: the angle about its first axis, from the direction of the rod."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.bench.simulator.poses import VirtualPoses, exp
from gtpin.bench.simulator.rods import NUDGE, VirtualRodEnds
from gtpin.bench.simulator.tree import read_urdf, way_from
from gtpin.errors import RobotError
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

STRIDES, STEPS = 12, 8
"""Equal steps from the rod's direction at the URDF's zero to the wanted one, and Newton's steps at the end."""
CLOSED = 1e-12
"""Largest difference of two unit vectors that count as equal."""


@dataclass(frozen=True, eq=False)
class Universal:
    """Two axes that intersect: at angles x the rod has the direction R1 exp(a1 x1) R2 exp(a2 x2) t in the TCP frame."""

    name: str  # Name of the joint of the first axis, whose angle an encoder reads
    # `R1`, `R2`: (3, 3) rotations of the first joint's frame to the TCP frame, and of the second's to the first's
    R1: Floats
    R2: Floats
    # `a1`, `a2`, `t`: (3,) unit vectors: each axis in its joint's frame, and the rod's direction in the second joint's
    # frame
    a1: Floats
    a2: Floats
    t: Floats

    @staticmethod
    def of(robot: Chain) -> Universal:
        """The joint of the first rod. Names are from ``robot``, numbers from the URDF's text.

        Raises RobotError if the rod is not connected to the platform by two revolute joints.
        """
        urdf = read_urdf(robot.description.xml, still=("floating",))
        rod = robot.rods[0]
        loop = robot.description.loops[rod.loop]
        end = (loop.anchor1, loop.anchor2)[rod.rod_end]
        on = urdf.links[end.link]
        way = way_from(urdf.joints, on.joint)
        driven = {actuator.joint for actuator in robot.actuators}
        free = [j for j in reversed(way) if urdf.joints[j].name not in driven]
        tcp = urdf.links[robot.tcp_frame]
        if len(free) != 2 or any(urdf.joints[j].slides for j in free) or urdf.joints[free[0]].parent != tcp.joint:
            raise RobotError(f"rod {rod.name} hangs on no universal joint", hint="read another instrument")
        first, second = (urdf.joints[j] for j in free)
        tip = on.p + on.R @ np.array(end.xyz)
        for j in way[: way.index(free[1])]:
            tip = urdf.joints[j].p + urdf.joints[j].R @ tip
        t = tip / np.linalg.norm(tip)
        return Universal(first.name, tcp.R.T @ first.R, second.R, first.axis, second.axis, t)

    def coordinate(self, poses: VirtualPoses, ends: VirtualRodEnds) -> Floats:
        """(N,) angle about the first axis, rad, at poses with the rods' ends; NaN where the rod is parallel to the axis."""
        return self._angles(self._direction(poses, ends))[:, 0]

    def by_motion(
        self, poses: VirtualPoses, ends: VirtualRodEnds, J: Floats, moved: list[tuple[VirtualRodEnds, VirtualRodEnds]]
    ) -> Floats:
        """(N, 1, m) derivative of the angle by m numbers; J (N, 6, m) is the derivative of the poses by them.

        ``moved`` has the rods' ends with each number larger, and smaller, by ``NUDGE``.
        """
        u = self._direction(poses, ends)
        x = self._angles(u)
        found = []
        for way, (more, less) in zip(NUDGE * np.moveaxis(J, 2, 0), moved, strict=True):
            turn = exp(way[:, 3:])
            ahead = self._direction(VirtualPoses(poses.T + way[:, :3], turn @ poses.R), more)
            behind = self._direction(VirtualPoses(poses.T - way[:, :3], np.swapaxes(turn, 1, 2) @ poses.R), less)
            found.append(self._step(x, (ahead - behind) / (2.0 * NUDGE))[:, 0])
        return np.stack(found, axis=1)[:, None]

    def _direction(self, poses: VirtualPoses, ends: VirtualRodEnds) -> Floats:
        """(N, 3) unit vector along the rod, away from the platform, TCP frame."""
        away = -np.einsum("nji,nj->ni", poses.R, ends.rods(poses)[0][:, 0])
        return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True))

    def _points(self, x: Floats) -> Floats:
        """(N, 3) direction of the rod at angles (N, 2), rad, TCP frame."""
        turned = exp(x[:, :1] * self.a1) @ self.R2 @ exp(x[:, 1:] * self.a2)
        return np.asarray(turned @ self.t @ self.R1.T)

    def _step(self, x: Floats, change: Floats) -> Floats:
        """(N, 2) change of the angles, rad, that changes the direction by ``change`` (N, 3)."""
        first = exp(x[:, :1] * self.a1)
        inner = exp(x[:, 1:] * self.a2) @ self.t
        ways = (np.cross(self.a1, (first @ self.R2 @ inner[..., None])[..., 0]), np.cross(self.a2, inner))
        slopes = np.stack([ways[0], (first @ self.R2 @ ways[1][..., None])[..., 0]], axis=2)
        return np.asarray((np.linalg.pinv(self.R1 @ slopes) @ change[..., None])[..., 0])

    def _angles(self, u: Floats) -> Floats:
        """(N, 2) angles, rad, at which the rod has the directions u (N, 3): the solution connected to the URDF's zero."""
        x = np.zeros((len(u), 2))
        start = self._points(x)
        for s in np.arange(1, STRIDES + 1) / STRIDES:
            goal = start + s * (u - start)
            goal = goal / np.linalg.norm(goal, axis=1, keepdims=True)
            for _ in range(1 if s < 1.0 else STEPS):
                x = x + np.clip(self._step(x, goal - self._points(x)), -0.5, 0.5)
        x[np.abs(self._points(x) - u).max(axis=1) > CLOSED] = np.nan
        return x
