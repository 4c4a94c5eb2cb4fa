"""A nominal arm, from its URDF: the commanded joints, the TCP, the payload that it may carry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.arms.urdf import Frame, Joint, Urdf, read_urdf
from gtpin.errors import RobotError
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

TOLERANCE = 5e-4
"""Standard deviation of every placement, per axis, m and rad, where the URDF gives none."""
CARRIES = 0.2
"""Payload over moving mass. A UR5 carries 5 kg with a mass of 18 kg, a Panda 3 kg with 16 kg, a UR10 10 kg with 27 kg (their
data sheets)."""
SHORTEST = 0.05
"""Smallest length of a link, m: the housings of a wrist are longer than the offsets between its axes."""


@dataclass(frozen=True, eq=False)
class Arm:
    """The nominal robot: an open chain.

    Parameters
    ----------
    name
    joints
        All its moving joints, parents first.
    counted
        Indices of the commanded joints, in the order of q.
    tcp
        The TCP frame.
    gravity
        (3,) acceleration of gravity, base frame, m/s^2.
    tolerance
        (6,) standard deviation of the placement of each joint and of the tool, m and rad.
    """

    name: str
    joints: tuple[Joint, ...]
    counted: tuple[int, ...]
    tcp: Frame
    gravity: Floats
    tolerance: Floats

    @staticmethod
    def of(robot: Robot) -> Arm:
        """The arm of a robot without loops. Names and the choice of joints are from ``robot``, numbers from the URDF's text.

        Raises
        ------
        RobotError
            If the robot has loops.
        """
        if robot.description.loops:
            raise RobotError(f"{robot.name} has loops", hint="an open chain has none")
        urdf: Urdf = read_urdf(robot.description.xml)
        return Arm(
            robot.name,
            urdf.joints,
            tuple(urdf.index(actuator.joint) for actuator in robot.actuators),
            urdf.links[robot.tcp_frame],
            np.array(robot.description.gravity),
            tolerance_of(robot),
        )

    @property
    def n_actuators(self) -> int:
        """Number of commands."""
        return len(self.counted)

    @cached_property
    def sites(self) -> tuple[str, ...]:
        """Names of the commanded joints."""
        return tuple(self.joints[j].name for j in self.counted)

    @cached_property
    def link_sites(self) -> tuple[str, ...]:
        """Names of the links that the commanded joints move."""
        return tuple(self.joints[j].link for j in self.counted)

    @property
    def placed(self) -> tuple[int, ...]:
        """Indices of the joints whose placements a calibration identifies."""
        return self.counted

    @property
    def linked(self) -> tuple[int, ...]:
        """Indices of the commands whose link is between base and TCP: it reaches from its joint to the next one, or the TCP."""
        return self.acting

    @cached_property
    def lower(self) -> Floats:
        """(n,) lower ends of the ranges, rad or m."""
        return np.array([self.joints[j].lower for j in self.counted])

    @cached_property
    def upper(self) -> Floats:
        """(n,) upper ends of the ranges, rad or m."""
        return np.array([self.joints[j].upper for j in self.counted])

    @cached_property
    def slides(self) -> npt.NDArray[np.bool_]:
        """(n,) whether a commanded joint is prismatic."""
        return np.array([self.joints[j].slides for j in self.counted])

    @cached_property
    def way(self) -> tuple[int, ...]:
        """Indices of all joints from the base to the TCP, called the way below."""
        found, joint = [], self.tcp.joint
        while joint >= 0:
            found.append(joint)
            joint = self.joints[joint].parent
        return tuple(reversed(found))

    @cached_property
    def acting(self) -> tuple[int, ...]:
        """Indices of the commands that move the TCP."""
        return tuple(c for c, j in enumerate(self.counted) if j in self.way)

    def onward(self, joint: int) -> tuple[int, ...]:
        """Indices of a joint on the way and of those beyond it."""
        return self.way[self.way.index(joint) :]

    def next_frame(self, joint: int) -> Frame:
        """End of the body of a joint on the way, as a frame on that body: at the next joint, for the last one at the TCP."""
        line = self.onward(joint)
        if len(line) == 1:
            return self.tcp
        following = self.joints[line[1]]
        return Frame(joint, following.R, following.p)

    def length(self, joint: int) -> float:
        """Length of the body of a joint on the way, m."""
        return max(float(np.linalg.norm(self.next_frame(joint).p)), SHORTEST)

    def reach_from(self, joint: int) -> float:
        """Length of the stretched chain from a joint on the way to the TCP, m."""
        return sum(self.length(j) for j in self.onward(joint))

    @cached_property
    def capacity(self) -> float:
        """Payload that it may carry, kg, from its moving mass, in steps of 0.5 kg."""
        mass = sum(joint.mass for joint in self.joints)
        return max(0.5, round(2.0 * CARRIES * mass) / 2.0)

    def usual_moment(self, joint: int) -> float:
        """Usual load of a joint on the way, N m (N if prismatic): 0.4 of that with the arm stretched out and full payload."""
        g, moment, way = float(np.linalg.norm(self.gravity)) or 9.81, 0.0, 0.0
        if self.joints[joint].slides:
            behind = sum(self.joints[j].mass for j in self.onward(joint))
            return 0.4 * g * (behind + self.capacity)
        for j in self.onward(joint):
            moment += self.joints[j].mass * (way + 0.5 * self.length(j))
            way += self.length(j)
        return 0.4 * g * (moment + self.capacity * way)


def tolerance_of(robot: Robot) -> Floats:
    """(6,) standard deviation of the placement of each joint and of the tool, m and rad."""
    told = robot.tolerance
    return np.array([told.get("placement_position", TOLERANCE)] * 3 + [told.get("placement_rotation", TOLERANCE)] * 3)
