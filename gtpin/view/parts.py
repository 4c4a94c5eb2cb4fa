"""The named parts of a machine, and where their names are drawn: carts or arms, rods, the platform."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.robot.robot import Robot
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class Part:
    """A part: its name, the number of the Pinocchio joint that it moves with, and its place (3,) in that joint's frame, m."""

    name: str
    joint: int
    at: Floats

    def place(self, data: Any) -> Floats:
        """(3,) place of the name in the base frame, m, with the joints' placements in a ``pinocchio.Data``."""
        return np.asarray(data.oMi[self.joint].act(self.at))


def parts(robot: Robot) -> tuple[Part, ...]:
    """The parts of a robot. Their names are drawn at the TCP (the platform), at the actuators' joints, and at the rods'
    middles."""
    found = {platform_name(robot): (robot.tcp_joint, robot.tcp_placement.translation)}
    found |= {actuator.site: (actuator.joint_id, np.zeros(3)) for actuator in robot.actuators}
    # A leg is an actuator and a rod: its name is drawn only once, at its middle.
    found |= {rod.site: _middle(robot, rod.loop, rod.rod_end) for rod in robot.rods}
    return tuple(Part(name, int(joint), np.array(at)) for name, (joint, at) in found.items())


def platform_name(robot: Robot) -> str:
    """The name of the link that carries the TCP."""
    bodies = (f for f in robot.model.frames if f.type == pin.FrameType.BODY and f.parentJoint == robot.tcp_joint)
    return str(next((frame.name for frame in bodies), robot.tcp_frame))


def rod_tip(robot: Robot, loop: int, end: int) -> tuple[int, Floats]:
    """Number of the Pinocchio joint that moves a rod, and (3,) place of the rod's free end in that joint's frame, m."""
    constraint = robot.constraints[loop]
    joint = (constraint.joint1_id, constraint.joint2_id)[end]
    return int(joint), np.array((constraint.joint1_placement, constraint.joint2_placement)[end].translation)


def joint_places(robot: Robot, data: Any, names: Iterable[str]) -> dict[str, Floats]:
    """(3,) where joints are in the base frame, m, by their names, from the placements in a ``pinocchio.Data``."""
    return {name: np.array(data.oMi[robot.model.getJointId(name)].translation) for name in names}


def _middle(robot: Robot, loop: int, end: int) -> tuple[int, Floats]:
    joint, tip = rod_tip(robot, loop, end)
    return joint, tip / 2.0
