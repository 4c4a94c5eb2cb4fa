"""Checks before an accuracy analysis: the robot can reach the poses and, where closures are analysed, has rods."""

from __future__ import annotations

import numpy as np

from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.kinematics import Kinematics, of_rods
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.model.model import Model
from gtpin.typing import Floats


def rod_kinematics(model: Model) -> RodKinematics:
    """The closures of a model with rods; raises `ModelError` if its robot has no rods."""
    return of_rods(model.kinematics)


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
