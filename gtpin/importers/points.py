"""Lists of points or poses, as metrology programs export them: SpatialAnalyzer's ASCII points, and similar ones.

SpatialAnalyzer's user manual, "Exporting ASCII Formatted Points": a line for each point, ``Collection Group Target x y z`` or
fewer names, between spaces or commas, in the working frame and the working unit; comments after ``//``. Neither unit nor
order are in the file, so the user gives both.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gtpin.data import Commands, Dataset, Instrument
from gtpin.data.names import ORIENTATION, POSITION, is_command
from gtpin.errors import DatasetError
from gtpin.importers.matched import Match, matched
from gtpin.importers.named_columns import (
    ANGLES,
    LENGTHS,
    Angle,
    Length,
    Separator,
    commands_among,
    read_named_columns,
)
from gtpin.robot.library import load_robot


def read_points(
    file: Path | str,
    robot: str,
    columns: list[str],
    separator: Separator,
    unit: Length,
    *,
    angle: Angle | None = None,
    commands: Commands | None = None,
    match: Match | None = None,
    within: float | None = None,
    header: int = 0,
    decimal_comma: bool = False,
    instrument: Instrument | None = None,
    tcp: str | None = None,
) -> Dataset:
    """Read a list of points or poses.

    Parameters
    ----------
    file
        The list.
    robot, tcp
        As in dataset.toml.
    columns, separator, header, decimal_comma
        See :func:`~gtpin.importers.named_columns.read_named_columns`.
    unit
        Unit of x, y and z, and of the commands of actuators that slide, where the list has them.
    angle
        Unit of the commands of actuators that turn, where the list has them.
    commands, match, within
        The commands, where the list has none, and how they are matched with its rows: see
        :func:`~gtpin.importers.matched.matched`.
    instrument
        The instrument; by default with unknown noise, a free frame and a free target.

    Raises
    ------
    GtpinError
        If a row is damaged, or columns or units are not given completely.
    """
    file = Path(file)
    if unit not in LENGTHS:
        raise DatasetError(f"the unit {unit!r} is not known", column="unit", hint=f"one of {', '.join(LENGTHS)}")
    own = commands_among(columns)
    if bool(own) == (commands is not None):
        what = "commands both in the list and in a table" if own else "there are no commands"
        hint = "name the columns q1 .. qn (--columns), or give a table of commands (--commands), and not both"
        raise DatasetError(what, file=file, hint=hint)
    if commands is not None and match is None:
        hint = "give --match pose|row|time"
        raise DatasetError("it is not said which command belongs to which row", column="match", hint=hint)
    table = read_named_columns(file, columns, separator, header=header, decimal_comma=decimal_comma)
    covariates = {
        name: values
        for name, values in table.values.items()
        if name not in (*POSITION, *ORIENTATION) and not is_command(name)
    }
    numbered = np.array([str(number) for number in range(1, len(table.row) + 1)], dtype=object)
    if commands is None:
        q = np.column_stack([table.values[name] for name in own]) * _scale(robot, tcp, len(own), unit, angle)
        pose = numbered if table.pose is None else table.pose
    else:
        assert match is not None
        time = table.values.get("time")
        at = matched(commands, match, file=file, row=table.row, pose=table.pose, time=time, within=within)
        q, pose = commands.q[at], commands.pose[at]
        covariates = {name: values[at] for name, values in commands.covariates.items()} | covariates
    turned = ORIENTATION[0] in table.values
    return Dataset(
        robot=robot,
        pose=pose,
        q=q,
        position=np.column_stack([table.values[name] for name in POSITION]) * LENGTHS[unit],
        orientation=np.column_stack([table.values[name] for name in ORIENTATION]) if turned else None,
        covariates=covariates,
        instrument=instrument or Instrument(frame="free", target="free"),
        tcp=tcp,
        row=table.row,
        file=file,
    )


def _scale(robot: str, tcp: str | None, count: int, unit: Length, angle: Angle | None) -> np.ndarray:
    """(n,) factor from the unit of each command to m or rad."""
    revolute = load_robot(robot, tcp).revolute
    if len(revolute) != count:
        what = f"{count} columns of commands for the {len(revolute)} actuators of {robot}"
        raise DatasetError(what, column="columns", hint="name one for each, q1 .. qn")
    if revolute.any() and angle not in ANGLES:
        what = "the unit of the angles is not given"
        raise DatasetError(what, column="angle", hint=f"give --angle {'|'.join(ANGLES)}")
    return np.where(revolute, ANGLES[angle] if angle is not None else np.nan, LENGTHS[unit])
