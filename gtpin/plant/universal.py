"""The universal joint by which a rod hangs on the platform: how far its first axis is turned, by where the rod points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.errors import RobotError
from gtpin.plant.arms.urdf import read_urdf
from gtpin.plant.closing import RodEnds
from gtpin.plant.poses import Poses
from gtpin.plant.rods import NUDGE
from gtpin.plant.rotations import exp
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]

STRIDES, STEPS = 12, 8
"""On the way from the URDF's zero to where the rod points, and Newton's steps at its end."""
CLOSED = 1e-12
"""Difference of two unit vectors that counts as none."""


@dataclass(frozen=True, eq=False)
class Universal:
    """Two axes that cross: at angles x the rod points along R1 exp(a1 x1) R2 exp(a2 x2) t in the TCP frame.

    Parameters
    ----------
    name
        Of the joint of the first axis, whose angle is read.
    rod
        Index of the rod.
    R1, R2
        (3, 3) placement of the first joint's frame in the TCP frame, and of the second's in the first's.
    a1, a2, t
        (3,) unit vectors: the axes, and the rod, own frames.
    """

    name: str
    rod: int
    R1: Floats
    R2: Floats
    a1: Floats
    a2: Floats
    t: Floats

    @staticmethod
    def of(robot: Robot, rod: int) -> Universal:
        """The joint of a rod: names are the package's, numbers those of the URDF's text.

        Raises
        ------
        RobotError
            If the rod does not hang on the platform by two turning joints.
        """
        urdf = read_urdf(robot.description.xml, still=("floating",))
        loop, which = robot.description.loops[robot.rods[rod].loop], robot.rods[rod].rod_end
        end = (loop.anchor1, loop.anchor2)[which]
        on = urdf.links[end.link]
        way = [on.joint]
        while urdf.joints[way[-1]].parent >= 0:
            way.append(urdf.joints[way[-1]].parent)
        driven = {actuator.joint for actuator in robot.actuators}
        free = [j for j in reversed(way) if urdf.joints[j].name not in driven]
        tcp = urdf.links[robot.tcp_frame]
        if len(free) != 2 or any(urdf.joints[j].slides for j in free) or urdf.joints[free[0]].parent != tcp.joint:
            raise RobotError(f"rod {robot.rods[rod].name} hangs on no universal joint", hint="read another instrument")
        first, second = (urdf.joints[j] for j in free)
        tip = on.p + on.R @ np.array(end.xyz)
        for j in way[: way.index(free[1])]:
            tip = urdf.joints[j].p + urdf.joints[j].R @ tip
        return Universal(
            first.name, rod, tcp.R.T @ first.R, second.R, first.axis, second.axis, tip / np.linalg.norm(tip)
        )

    def coordinate(self, poses: Poses, ends: RodEnds) -> Floats:
        """(N,) angle about the first axis, rad, where rods have some ends; NaN where the rod lies along it."""
        return self._angles(self._direction(poses, ends))[:, 0]

    def by_motion(self, poses: Poses, ends: RodEnds, J: Floats, moved: list[tuple[RodEnds, RodEnds]]) -> Floats:
        """(N, 1, m) derivative of the angle by m numbers, by which the poses move as J (N, 6, m) says.

        ``moved`` are the ends where each number is larger, and smaller, by ``NUDGE``.
        """
        u = self._direction(poses, ends)
        x = self._angles(u)
        found = []
        for way, (more, less) in zip(NUDGE * np.moveaxis(J, 2, 0), moved, strict=True):
            turn = exp(way[:, 3:])
            ahead = self._direction(Poses(poses.T + way[:, :3], turn @ poses.R), more)
            behind = self._direction(Poses(poses.T - way[:, :3], np.swapaxes(turn, 1, 2) @ poses.R), less)
            found.append(self._step(x, (ahead - behind) / (2.0 * NUDGE))[:, 0])
        return np.stack(found, axis=1)[:, None]

    def _direction(self, poses: Poses, ends: RodEnds) -> Floats:
        """(N, 3) unit vector along the rod, away from the platform, TCP frame."""
        away = -np.einsum("nji,nj->ni", poses.R, ends.rods(poses)[0][:, self.rod])
        return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True))

    def _points(self, x: Floats) -> Floats:
        """(N, 3) where the rod points at angles (N, 2)."""
        turned = exp(x[:, :1] * self.a1) @ self.R2 @ exp(x[:, 1:] * self.a2)
        return np.asarray(turned @ self.t @ self.R1.T)

    def _step(self, x: Floats, change: Floats) -> Floats:
        """(N, 2) change of the angles that changes the direction by (N, 3)."""
        first = exp(x[:, :1] * self.a1)
        inner = exp(x[:, 1:] * self.a2) @ self.t
        ways = (np.cross(self.a1, (first @ self.R2 @ inner[..., None])[..., 0]), np.cross(self.a2, inner))
        slopes = np.stack([ways[0], (first @ self.R2 @ ways[1][..., None])[..., 0]], axis=2)
        return np.asarray((np.linalg.pinv(self.R1 @ slopes) @ change[..., None])[..., 0])

    def _angles(self, u: Floats) -> Floats:
        """(N, 2) angles at which the rod points along unit vectors (N, 3), on the side of the URDF's zero."""
        x = np.zeros((len(u), 2))
        start = self._points(x)
        for s in np.arange(1, STRIDES + 1) / STRIDES:
            goal = start + s * (u - start)
            goal = goal / np.linalg.norm(goal, axis=1, keepdims=True)
            for _ in range(1 if s < 1.0 else STEPS):
                x = x + np.clip(self._step(x, goal - self._points(x)), -0.5, 0.5)
        x[np.abs(self._points(x) - u).max(axis=1) > CLOSED] = np.nan
        return x
