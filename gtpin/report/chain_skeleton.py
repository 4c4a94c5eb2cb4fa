"""A robot without rods as lines in space, through its joints' origins to the TCP."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gtpin.kinematics.bodies import bodies, index_of
from gtpin.model.model import Model
from gtpin.robot.chain import joint_axis
from gtpin.robot.moving_links import moving_links
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


@dataclass(frozen=True)
class ChainSkeleton:
    """A robot without rods at one command, base frame, m.

    Parameters
    ----------
    joints, axes
        By actuated joint: (3,) its origin and the unit vector of its axis.
    links
        By moving link: (2, 3) positions of its own joint and of its tip.
    fixed
        (m, 2, 3) lines from the base to the first joints, and along bodies that no actuated joint moves.
    tcp
        (3,) the TCP.
    up
        (3,) unit vector against gravity.
    """

    joints: Mapping[str, Floats]
    axes: Mapping[str, Floats]
    links: Mapping[str, Floats]
    fixed: Floats
    tcp: Floats
    up: Floats

    @property
    def points(self) -> Floats:
        """(m, 3) all points."""
        return np.vstack([np.stack(list(self.joints.values())), self.fixed.reshape(-1, 3), self.tcp[None]])

    @property
    def lines(self) -> tuple[Floats, Floats]:
        """(m, 3) start points and end points of the drawing's lines."""
        lines = np.concatenate([np.stack(list(self.links.values())), self.fixed]) if self.links else self.fixed
        return lines[:, 0], lines[:, 1]


def chain_skeleton(model: Model, q: Floats | None = None) -> ChainSkeleton | None:
    """The skeleton at a command (n,), by default home; None for robots with rods, or if the pose can't be reached."""
    if model.robot.rod_sites:
        return None
    robot = model.kinematics.robot
    at = bodies(robot, (robot.home_q if q is None else q)[None])
    R, T = at.R[0], at.T[0]
    if not np.isfinite(T).all():
        return None
    joints, axes = {}, {}
    for actuator in robot.actuators:
        twist, index = joint_axis(robot.model, actuator.joint_id), index_of(actuator.joint_id)
        joints[actuator.site], axes[actuator.site] = (
            T[index],
            R[index] @ (twist[3:] if actuator.revolute else twist[:3]),
        )
    links = {link.name: T[[index_of(link.joint_id), link.tip]] for link in moving_links(robot)}
    gravity = np.asarray(robot.model.gravity.linear, dtype=float)
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
    return ChainSkeleton(joints, axes, links, _fixed(robot, T, links), T[-1], up)


def _fixed(robot: Robot, T: Floats, links: Mapping[str, Floats]) -> Floats:
    """(m, 2, 3) lines from each joint's parent to the joint, and to the TCP, without those of moving links."""
    drawn = {(tuple(a), tuple(b)) for a, b in links.values()}
    found = []
    for j in range(1, robot.model.njoints):
        parent = int(robot.model.parents[j])
        line = np.stack([T[index_of(parent)] if parent else np.zeros(3), T[j - 1]])
        if (tuple(line[0]), tuple(line[1])) not in drawn:
            found.append(line)
    last = np.stack([T[index_of(robot.tcp_joint)] if robot.tcp_joint else np.zeros(3), T[-1]])
    if (tuple(last[0]), tuple(last[1])) not in drawn:
        found.append(last)
    return np.array(found).reshape(-1, 2, 3)
