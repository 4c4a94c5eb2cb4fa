"""Predicted poses at a table of commands."""

from __future__ import annotations

import numpy as np

from gtpin.data import Commands
from gtpin.data.table import Column
from gtpin.effects.active import warn_of_extrapolation
from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.robot.command_ranges import check_commands, without_whole_turns


def predict(model: Model, commands: Commands) -> Poses:
    """Poses at commands, in the instrument's frame, in the order given.

    Raises `DatasetError` if the commands do not fit the robot. `ModelError` if a command leaves a measured track, or a
    covariate is missing that an active effect needs; the message names the row or the column. `UnreachableError` if a pose
    can't be reached; the message names its row. Warns: names effects that are extrapolated, and where they were fitted.
    """
    poses = predicted(model, commands)
    lost = np.flatnonzero(~poses.reached)
    if lost.size:
        first = int(lost[0])
        more = f" (and {lost.size - 1} more)" if lost.size > 1 else ""
        raise UnreachableError(
            f"{model.robot.name} can't reach pose {commands.pose[first]}{more} from its home without opening its loops",
            file=commands.file,
            row=int(commands.row[first]),
            hint="leave it out, or check its commands, and the assembly that its home chooses",
        )
    return poses


def predicted(model: Model, commands: Commands) -> Poses:
    """As :func:`predict`, with NaN for the poses that can't be reached."""
    robot = model.robot
    commands = without_whole_turns(commands, robot)
    check_commands(commands, robot)
    outside = np.flatnonzero(model.geometry.outside(commands.q))
    if outside.size:
        raise ModelError(
            f"pose {commands.pose[outside[0]]} leaves the range in which the tracks were measured",
            file=commands.file,
            row=int(commands.row[outside[0]]),
            hint="leave it out, or use a model with straight tracks",
        )
    warn_of_extrapolation(model.effects, robot, commands.q, commands.covariates)
    try:
        return model.predict(commands.q, commands.covariates)
    except ModelError as error:
        raise ModelError(error.what, file=commands.file, column=error.column, hint=error.hint) from None


def prediction_columns(commands: Commands, poses: Poses) -> dict[str, Column]:
    """Poses as the columns ``pose x y z qw qx qy qz`` of a table: m, and unit quaternions."""
    columns = {"pose": commands.pose, **dict(zip("xyz", poses.T.T, strict=True))}
    return columns | dict(zip(("qw", "qx", "qy", "qz"), poses.quaternions.T, strict=True))
