"""Passive joints whose coordinates are measured: the loops move them, and an encoder reads them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError
from gtpin.robot.constrained_model import ConstrainedModel, joint_axis
from gtpin.robot.tree import listed


@dataclass(frozen=True)
class MeasuredJoint:
    """A passive joint of one coordinate that is measured.

    - ``name``, ``joint_id``: its name in the URDF, and its index among Pinocchio's joints.
    - ``passive``: its index among the passive coordinates.
    - ``turns``: whether its coordinate is an angle, rad, instead of a distance, m.
    """

    name: str
    joint_id: int
    passive: int
    turns: bool


def readable(robot: ConstrainedModel) -> tuple[str, ...]:
    """Names of the joints that can be measured: those of one coordinate that nothing but the loops moves."""
    model, passive = robot.model, _passive(robot)
    return tuple(
        name for name, nv, at in zip(model.names, model.nvs, model.idx_vs, strict=True) if nv == 1 and at in passive
    )


def measured_joint(robot: ConstrainedModel, name: str) -> MeasuredJoint:
    """The passive joint of a name.

    Raises `RobotError` if there is none: no such joint, or one that is driven, fixed, follows another, or has several
    coordinates.
    """
    known = readable(robot)
    if name not in known:
        what = f"joints that can be read: {listed(known, 12)}"
        hint = what if known else "no joint of this robot is moved by its loops alone"
        raise RobotError(_why_not(robot, name), column="joint", hint=hint)
    joint_id = int(robot.model.getJointId(name))
    passive = _passive(robot).index(robot.model.idx_vs[joint_id])
    return MeasuredJoint(name, joint_id, passive, bool(joint_axis(robot.model, joint_id)[3:].any()))


def _why_not(robot: ConstrainedModel, name: str) -> str:
    model = robot.model
    for number, actuator in enumerate(robot.actuators):
        if name == actuator.joint:
            return f"joint {name} is driven by q{number + 1}: an encoder reads a joint that nothing drives"
    for mimic in robot.description.tree.mimics:
        if name == mimic.joint:
            return f"joint {name} follows {mimic.master} by <mimic>: an encoder reads a joint that only loops move"
    if model.existJointName(name):
        return f"joint {name} has {model.nvs[model.getJointId(name)]} coordinates: an encoder reads one"
    if model.existFrame(name, pin.FrameType.FIXED_JOINT):
        return f"joint {name} does not move: it is fixed, or no command and no loop moves it"
    return f"{robot.name} has no joint {name!r}"


def _passive(robot: ConstrainedModel) -> list[int]:
    """Velocity indices of the passive coordinates."""
    return [int(v) for v in np.arange(robot.model.nv)[robot.passive]]
