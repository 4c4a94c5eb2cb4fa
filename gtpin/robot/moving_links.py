"""The links that the actuated joints of a robot without rods move."""

from __future__ import annotations

from dataclasses import dataclass

import pinocchio as pin

from gtpin.robot.constrained_model import ConstrainedModel


@dataclass(frozen=True)
class MovingLink:
    """The child link of an actuated joint, with everything fixed to it. It reaches from that joint's frame to its tip.

    ``name``: its name in the URDF. ``joint_id``: the Pinocchio joint that moves it. ``tip``: index, as in
    :class:`~gtpin.kinematics.motion.Motion`, of the placement frame of the next joint; of the TCP for the last link.
    """

    name: str
    joint_id: int
    tip: int


def moving_links(robot: ConstrainedModel) -> tuple[MovingLink, ...]:
    """The links of the actuated joints, in the joints' order; those without a joint or TCP beyond them are left out."""
    names: dict[int, str] = {}
    for frame in robot.model.frames:
        if frame.type == pin.FrameType.BODY:
            names.setdefault(int(frame.parentJoint), str(frame.name))
    found = []
    for joint_id in (actuator.joint_id for actuator in robot.actuators):
        tip = _tip(robot, joint_id)
        if tip is not None and joint_id in names:
            found.append(MovingLink(names[joint_id], joint_id, tip))
    return tuple(found)


def _tip(robot: ConstrainedModel, joint_id: int) -> int | None:
    """Index of the frame at a link's tip: the next joint towards the TCP, else its first child joint; None: it has none."""
    model = robot.model
    if joint_id == robot.tcp_joint:
        return int(model.njoints - 1)
    path = list(model.supports[robot.tcp_joint])
    if joint_id in path:
        return int(path[path.index(joint_id) + 1]) - 1
    children = [j for j in range(1, model.njoints) if model.parents[j] == joint_id]
    return children[0] - 1 if children else None
