"""Passive joints whose coordinates are measured: the loops move them, and an encoder reads them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError
from gtpin.robot.constrained_model import ConstrainedModel, joint_axis
from gtpin.typing import Floats

SHOWN = 12
"""Largest number of joints that a hint lists."""


@dataclass(frozen=True)
class MeasuredJoint:
    """A passive joint of one coordinate that is measured.

    - ``name``: its name in the URDF.
    - ``joint_id``, ``index_q``: its index among Pinocchio's joints, and its first index in a configuration.
    - ``passive``: its index among the passive coordinates.
    - ``turns``: whether its coordinate is an angle, rad, instead of a distance, m.
    - ``continuous``: whether Pinocchio keeps its coordinate as cosine and sine; then it is between -pi and pi.
    """

    name: str
    joint_id: int
    index_q: int
    passive: int
    turns: bool
    continuous: bool

    def coordinates(self, X: Floats) -> Floats:
        """(N,) its coordinate, rad or m, in Pinocchio configurations X (N, nq)."""
        here = X[:, self.index_q]
        return np.asarray(np.arctan2(X[:, self.index_q + 1], here) if self.continuous else here.copy())


def readable(robot: ConstrainedModel) -> tuple[str, ...]:
    """Names of the joints that can be measured: those of one coordinate that nothing but the loops moves."""
    passive = set(_passive(robot))
    model = robot.model
    return tuple(
        model.names[j] for j in range(1, model.njoints) if model.nvs[j] == 1 and int(model.idx_vs[j]) in passive
    )


def measured_joint(robot: ConstrainedModel, name: str) -> MeasuredJoint:
    """The passive joint of a name.

    Raises `RobotError` if there is none: no such joint, or one that is driven, fixed, follows another, or has several
    coordinates.
    """
    model, known = robot.model, readable(robot)
    if name in known:
        joint_id = int(model.getJointId(name))
        turns = bool(joint_axis(model, joint_id)[3:].any())
        passive = _passive(robot).index(int(model.idx_vs[joint_id]))
        return MeasuredJoint(
            name, joint_id, int(model.idx_qs[joint_id]), passive, turns, bool(model.nqs[joint_id] == 2)
        )
    listed = f"{', '.join(known[:SHOWN])}{' ...' if len(known) > SHOWN else ''}"
    hint = f"joints that can be read: {listed}" if known else "no joint of this robot is moved by its loops alone"
    raise RobotError(_why_not(robot, name), column="joint", hint=hint)


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
