"""Assigns commands to readings, where readings and commands are in separate files."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from gtpin.data import Commands
from gtpin.data.ids import Ids
from gtpin.errors import DatasetError, warn
from gtpin.robot.chain import Chain
from gtpin.robot.command_ranges import check_commands, without_whole_turns
from gtpin.typing import Floats

MOST_LOST = 0.5
"""Share of the readings, and of the commands, that may have no partner in time; where both lack more, the clocks differ.
Assumed."""
Match = Literal["pose", "row", "time"]


def in_range(commands: Commands, robot: Chain) -> Commands:
    """The commands, less whole turns where they are in the robot's range then.

    Raises `DatasetError` for a command that is far outside the range, with the unit that it looks like.
    """
    commands = without_whole_turns(commands, robot)
    check_commands(commands, robot)
    return commands


def matched(
    commands: Commands,
    by: Match,
    *,
    file: Path,
    row: npt.NDArray[np.int64],
    pose: Ids | None = None,
    time: Floats | None = None,
    within: float | None = None,
) -> npt.NDArray[np.intp]:
    """(N,) index, in the table of commands, of the command of each reading; -1 of a reading that has none.

    ``commands``: the table of commands. ``by``: ``pose``: the command with the same id. ``row``: the command in the same
    row; both tables must have the same length. ``time``: the command that is nearest in time, and none where that is farther
    than ``within``, s. ``file``, ``row``: file of the readings, and the (N,) line of each. ``pose``, ``time``: (N,) ids and
    times, s, of the readings.

    Raises `DatasetError` if one of the tables lacks the column that is needed; if a reading's pose has no command; if so few
    readings are near a command that the clocks can't be the same. Warns of readings that are left out.
    """
    if by == "row":
        if len(commands.pose) != len(row):
            what = f"{len(row)} rows, and {len(commands.pose)} of commands in {commands.file}"
            raise DatasetError(what, file=file, hint="give as many commands, or match by pose or time")
        return np.arange(len(row))
    if by == "pose":
        if pose is None:
            hint = "name it, or match by row or time"
            raise DatasetError("no column is named pose", file=file, column="pose", hint=hint)
        place = {name: number for number, name in reversed([*enumerate(commands.pose)])}
        for name, line in zip(pose, row, strict=True):
            if name not in place:
                what = f"there is no command of pose {name[:40]} in {commands.file}"
                raise DatasetError(what, file=file, row=int(line), column="pose", hint="add it, or delete the row")
        return np.array([place[name] for name in pose], dtype=np.intp)
    if by != "time":
        raise DatasetError(f"match {by!r} is not known", column="match", hint="pose, row or time")
    if time is None:
        raise DatasetError("the readings have no time", file=file, column="time", hint="match by pose or row")
    if "time" not in commands.covariates:
        raise DatasetError("the column is missing", file=commands.file, row=1, column="time", hint="add it, in s")
    if within is None or not 0.0 < within < np.inf:
        hint = "say how far apart a reading and its command may be, s (--within 0.02)"
        raise DatasetError("matching by time needs a longest time between them", column="within", hint=hint)
    known = np.asarray(commands.covariates["time"], dtype=float)
    order = np.argsort(known, kind="stable")
    after = np.clip(np.searchsorted(known[order], time), 1, max(1, len(order) - 1))
    either = order[np.column_stack([after - 1, np.minimum(after, len(order) - 1)])]
    apart = np.abs(known[either] - time[:, None])
    nearest: npt.NDArray[np.intp] = either[np.arange(len(time)), apart.argmin(axis=1)]
    far = ~(apart.min(axis=1) <= within)
    left = np.unique(nearest[~far])
    # A stream has readings between rests, and a log has commands that nobody measured: one of the two is usual.
    if far.mean() > MOST_LOST and len(left) < (1.0 - MOST_LOST) * len(known):
        first = int(np.flatnonzero(far)[0])
        what = f"{far.sum():,} of {len(far):,} rows are farther than {within:g} s from a command in {commands.file}"
        hint = (
            f"check that both have one clock and unit: of this row the nearest is {apart.min(axis=1)[first]:.6g} s away"
        )
        raise DatasetError(what, file=file, row=int(row[first]), column="time", hint=hint)
    if far.any():
        warn(
            f"{file}: {far.sum():,} of {len(far):,} rows are farther than {within:g} s from a command: they are left out"
        )
    return np.where(far, -1, nearest)
