"""A check before an accuracy analysis: the robot can reach the poses."""

from __future__ import annotations

import numpy as np

from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.poses import Poses
from gtpin.typing import Floats


def reached_poses(kinematics: Kinematics, q: Floats) -> Poses:
    """Poses (N), base frame, at commands q (N, n).

    Raises `ModelError` if there are no commands, or they do not have that shape. `UnreachableError` if one can't be
    reached; the message names its row, counted from 0.
    """
    robot = kinematics.geometry.robot
    poses = kinematics.forward(q)
    if not len(poses):
        raise ModelError("no commands", hint="give at least one")
    lost = np.flatnonzero(~poses.reached)
    if lost.size:
        raise UnreachableError(f"{robot.name} can't reach the commands in row {lost[0]}", hint="leave them out")
    return poses
