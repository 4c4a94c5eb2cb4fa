"""Coordinates of the universal joints of rods on the platform, from the directions of the rods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.errors import ModelError
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import home
from gtpin.kinematics.rotations import exp, skew
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.measured_joints import MeasuredJoint, measured_joint
from gtpin.robot.rods import Rod
from gtpin.typing import Floats


@dataclass(frozen=True)
class RodJoint:
    """A measured joint of a rod's universal joint: the rod points along A exp(a1 x1) B exp(a2 x2) t in the TCP frame.

    - ``joint``: the measured joint.
    - ``rod``: index of its rod.
    - ``second``: whether it is the second of the two joints, x2.
    - ``A``, ``B``: (3, 3) rotations of the two placement frames: the first in the TCP frame, the second in the first
      joint's.
    - ``a1``, ``a2``, ``t``: (3,) unit vectors: the axes, and the rod in the second joint's frame.
    - ``side``: +1 or -1: which of the two possible values x2 has in the assembly mode of home.
    """

    joint: MeasuredJoint
    rod: int
    second: bool
    A: Floats
    B: Floats
    a1: Floats
    a2: Floats
    t: Floats
    side: float

    @staticmethod
    def of(robot: Chain, joint: MeasuredJoint) -> RodJoint:
        """Find the rod of a joint.

        Raises `ModelError` if it does not belong to a rod's universal joint.
        """
        for i, rod in enumerate(robot.rods):
            chain = _passive_chain(robot, rod)
            if joint.joint_id in chain and len(chain) == 2:
                return _of_rod(robot, joint, i, chain)
        raise ModelError(f"joint {joint.name} is not of a rod's universal joint", hint="read one of these")

    def angles(self, u: Floats) -> tuple[Floats, Floats]:
        """(N,) x1 and x2, rad, at which the rod points along u (N, 3), TCP frame."""
        w = u @ self.A / np.linalg.norm(u, axis=1)[:, None]
        first, size, level = self._second()
        x2 = first + self.side * np.arccos(np.clip((w @ self.a1 - level) / size, -1.0, 1.0))
        v = self._beyond(x2)
        x1 = np.arctan2(np.cross(v, w) @ self.a1, (v * w).sum(axis=1) - (v @ self.a1) * (w @ self.a1))
        return x1, np.asarray(np.arctan2(np.sin(x2), np.cos(x2)))

    def coordinate(self, u: Floats) -> Floats:
        """(N,) coordinate of the joint, rad, where the rod points along u (N, 3), TCP frame."""
        return self.angles(u)[self.second]

    def by_direction(self, u: Floats) -> Floats:
        """(N, 3) derivative of the coordinate by u, rad/m."""
        x1, x2 = self.angles(u)
        w = u @ self.A / np.linalg.norm(u, axis=1)[:, None]
        turned = exp(x1[:, None] * self.a1) @ self.B
        across = np.cross(self.a2, np.einsum("nij,j->ni", exp(x2[:, None] * self.a2), self.t))
        ways = np.stack([np.cross(self.a1, w), np.einsum("nij,nj->ni", turned, across)], axis=2)
        slopes = np.linalg.pinv(self.A @ ways)[:, int(self.second)]
        return np.asarray(slopes / np.linalg.norm(u, axis=1)[:, None])

    def _second(self) -> tuple[float, float, float]:
        """``first``, ``size`` and ``level`` of a1 . (B exp(a2 x) t) = size cos(x - first) + level."""
        b = self.B.T @ self.a1
        level = float((b @ self.a2) * (self.a2 @ self.t))
        cosine, sine = float(b @ self.t) - level, float(b @ np.cross(self.a2, self.t))
        return float(np.arctan2(sine, cosine)), float(np.hypot(cosine, sine)), level

    def _beyond(self, x2: Floats) -> Floats:
        """(N, 3) unit vectors along the rod in the first joint's placement frame, at x1 = 0."""
        return np.asarray(np.einsum("nij,j->ni", exp(x2[:, None] * self.a2), self.t) @ self.B.T)


def direction(joint: RodJoint, poses: Poses, P: Floats, C: Floats) -> Floats:
    """(N, 3) vector along a joint's rod from P (k, 3), TCP frame, to C (N, k, 3), base frame; in the TCP frame, m."""
    away = C[:, joint.rod] - poses.T
    return np.asarray(np.einsum("nji,nj->ni", poses.R, away) - P[joint.rod])


def motion(joint: RodJoint, poses: Poses, P: Floats, C: Floats, moved: Floats, dC: Floats, dP: Floats) -> Floats:
    """(N, m) change of a joint's coordinate by motions of the platform and of the ends of its rod.

    ``poses``, ``P``, ``C``: as for :func:`direction`. ``moved``: (N, 6, m) motion of the platform, base frame. ``dC``,
    ``dP``: (N, 3, m) motion of the rod's joint on its carrier, base frame, and (3, m) of that on the platform, TCP frame,
    m.
    """
    away = skew(C[:, joint.rod] - poses.T)
    turned = dC - moved[:, :3] + away @ moved[:, 3:6]
    slope = joint.by_direction(direction(joint, poses, P, C))
    return np.asarray(np.einsum("ni,nim->nm", slope, np.swapaxes(poses.R, 1, 2) @ turned - dP))


def _passive_chain(robot: Chain, rod: Rod) -> list[int]:
    """Pinocchio's joints from the platform to a rod's end, without the driven ones."""
    driven = {actuator.joint_id for actuator in robot.actuators}
    chain = list(robot.model.supports[robot.anchors[rod.tip][0]])
    return [int(j) for j in chain[chain.index(rod.joint_id) :] if j not in driven]


def _of_rod(robot: Chain, joint: MeasuredJoint, index: int, chain: list[int]) -> RodJoint:
    model = robot.model
    first, second = chain
    tip, end = robot.anchors[robot.rods[index].tip]
    beyond = list(model.supports[tip])
    for j in reversed(beyond[beyond.index(second) + 1 :]):
        end = model.jointPlacements[j] * end
    t = end.translation / np.linalg.norm(end.translation)
    A = robot.tcp_placement.rotation.T @ model.jointPlacements[first].rotation
    B = model.jointPlacements[second].rotation
    a1, a2 = joint_axis(model, first)[3:], joint_axis(model, second)[3:]
    found = RodJoint(joint, index, joint.joint_id == second, A, B, a1, a2, t, 1.0)
    at_home = measured_joint(robot, model.names[second]).coordinate(home(robot).configuration)
    sine = float(np.sin(at_home - found._second()[0]))
    return RodJoint(joint, index, found.second, A, B, a1, a2, t, 1.0 if sine >= 0.0 else -1.0)
