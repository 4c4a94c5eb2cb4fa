"""Commands against the ranges of a robot's actuators: units, whole turns, and rows that are outside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from gtpin.data.commands import Commands
from gtpin.data.dataset import Dataset
from gtpin.data.files import warn_of
from gtpin.errors import DatasetError, warn
from gtpin.typing import Mask

Doubt = Callable[[DatasetError, Any], None]
"""Decides on a suspected mistake, by its error and the rows without the mistake: it raises the error, or returns."""

_NEARLY_ALL = 0.95
"""Share of a column's values that must fit another unit for the message that they look like it. Assumed."""
TURNS = 3.0
"""Turns from zero, in either direction, beyond which commands of a joint without limits look like degrees. Assumed."""
ONCE = 2.0 * np.pi
"""Angle, rad, by which a command may be off its range for whole turns to be taken off: one turn. Assumed: controllers count
from 0 to 360 degrees or to either side; commands in degrees are farther off."""
SHOWN = 10
"""Number of poses that a message names."""
_SEVERAL = 6
"""Fewest rows out of range for the message that a part of a column is in another unit. Assumed."""


def certainly(error: DatasetError, _: Any) -> None:
    """Raise the error: no mistake is doubted."""
    raise error


Rows = TypeVar("Rows", Dataset, Commands)


def without_whole_turns(
    rows: Rows, *, names: Sequence[str], lower: ArrayLike, upper: ArrayLike, revolute: ArrayLike
) -> Rows:
    """The rows with commands outside their ranges less a whole turn, in columns that fit their ranges then.

    A controller may count from 0 to 360 degrees where the robot's file has a range about 0. Columns with values that are
    more than a turn off the range, as degrees are, stay as they are. ``names`` to ``revolute``: as for :func:`check_commands`.

    Warns: names the column and the number of rows.
    """
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    turns = np.asarray(revolute, bool) & np.isfinite(high - low)
    if rows.n_actuators != len(names) or not turns.any():
        return rows
    middle, half = np.where(turns, (low + high) / 2.0, 0.0), np.where(turns, (high - low) / 2.0, np.inf)
    off = rows.q - middle
    whole = np.where(turns & (np.abs(off) > half), np.round(off / (2.0 * np.pi)), 0.0)
    inside = np.abs(off - 2.0 * np.pi * whole) <= half
    whole[:, (inside.mean(axis=0) < _NEARLY_ALL) | (np.abs(off) > ONCE + half).any(axis=0)] = 0.0
    whole[~inside] = 0.0
    if not whole.any():
        return rows
    q = rows.q - 2.0 * np.pi * whole
    for j in map(int, np.flatnonzero(whole.any(axis=0))):
        first, count = int(np.argmax(whole[:, j] != 0.0)), int(np.count_nonzero(whole[:, j]))
        warn_of(
            rows.file,
            f"q{j + 1}: a whole turn is taken off in {count} of {len(q)} rows, since {names[j]} turns from {low[j]:g} to "
            f"{high[j]:g} rad (in row {rows.place(first)[1]}, {rows.q[first, j]:g} becomes {q[first, j]:.6g})",
        )
    return replace(rows, q=q)


def check_commands(
    rows: Dataset | Commands,
    *,
    names: Sequence[str],
    lower: ArrayLike,
    upper: ArrayLike,
    revolute: ArrayLike,
    suspect: Doubt = certainly,
) -> None:
    """Check commands against the ranges of a robot's n actuators.

    Parameters
    ----------
    names
        Names of the actuators for messages, in the order of q.
    lower, upper, revolute
        (n,) ends of each range, m or rad, and whether the actuator turns.
    suspect
        What is done where most commands of a joint without limits are more than `TURNS` turns from zero, as degrees are.

    Raises `DatasetError` for another number of actuators, and for a command that is outside its range by more than the range's
    width, with the unit that it looks like; of a trusted dataset it only warns. Warns of poses that are outside by less.
    """
    low, high, turns = np.asarray(lower, float), np.asarray(upper, float), np.asarray(revolute, bool)
    if rows.n_actuators != len(names):
        what = f"{rows.n_actuators} columns of commands, but the robot has {len(names)} actuators ({', '.join(names)})"
        hint = "name the robot that was measured, or give one column for each actuator"
        if rows.n_actuators < len(names):
            hint += ", or name those that were commanded: actuators = [...] in dataset.toml"
        raise DatasetError(what, file=rows.file, column=f"q{rows.n_actuators}", hint=hint)
    beyond = np.maximum(low - rows.q, rows.q - high)
    far = beyond > high - low
    if far.any():
        index, actuator = (int(i) for i in np.argwhere(far)[0])
        limits = (low[actuator], high[actuator])
        error = _far_outside(rows, index, actuator, names[actuator], *limits, turns[actuator], far[:, actuator])
        if not getattr(rows, "trusted", False):
            raise error
        warn(str(error))
    _check_endless(rows, names, turns & ~np.isfinite(high - low), suspect)
    outside = (beyond > 1e-9 * np.where(np.isfinite(high - low), high - low, 0.0)).any(axis=1)
    if outside.any():
        warn_of(rows.file, f"commands a little outside the robot's range: {named_poses(rows, outside)}")


def _check_endless(rows: Dataset | Commands, names: Sequence[str], endless: Mask, suspect: Doubt) -> None:
    """Suspect commands of joints without limits, mostly `TURNS` turns and more from zero, nearly all within 360 degrees."""
    turn = 2.0 * np.pi
    for actuator in map(int, np.flatnonzero(endless)):
        q = np.abs(rows.q[:, actuator])
        if (q > TURNS * turn).mean() > 0.5 and (np.deg2rad(q) <= turn).mean() >= _NEARLY_ALL:
            index = int(np.argmax(q > TURNS * turn))
            what = f"most commands of {names[actuator]} are more than {TURNS:g} turns from zero, and look like degrees"
            hint = "write commands in rad; if the joint did turn so often, take whole turns away"
            file, line = rows.place(index)
            scaled = rows.q.copy()
            scaled[:, actuator] = np.deg2rad(scaled[:, actuator])
            error = DatasetError(what, file=file, row=line, column=f"q{actuator + 1}", hint=hint)
            suspect(error, replace(rows, q=scaled))


def _far_outside(
    rows: Dataset | Commands,
    index: int,
    actuator: int,
    name: str,
    low: float,
    high: float,
    turns: bool,
    far: Mask,
) -> DatasetError:
    right, other, factor = ("rad", "degrees", 180.0 / np.pi) if turns else ("m", "millimetres", 1000.0)
    q = rows.q[:, actuator]
    as_is, scaled = (float(np.mean((x >= low) & (x <= high))) for x in (q, q / factor))
    # Where most commands fit without a conversion, the others are separate errors, not a matter of units.
    looks = f", and the column looks like {other}" if scaled >= _NEARLY_ALL and as_is < 0.5 else ""
    what = f"{q[index]:g} is far outside the range of {name} ({low:g} to {high:g} {right})"
    hint = f"write commands in {right}" if looks else "correct the row, or leave it out"
    part = q[far] / factor
    if not looks and far.sum() >= _SEVERAL and ((part >= low) & (part <= high)).mean() >= _NEARLY_ALL:
        lines = [rows.place(int(i))[1] for i in np.flatnonzero(far)]
        looks = (
            f", and so are {far.sum()} of {len(q)} rows, the first in line {min(lines)} and the last in line {max(lines)} of "
            f"the file, which look like {other}"
        )
        hint = f"write commands of these rows in {right}"
    file, line = rows.place(index)
    return DatasetError(what + looks, file=file, row=line, column=f"q{actuator + 1}", hint=hint)


def named_poses(rows: Dataset | Commands, mask: Mask) -> str:
    """Text for a message with the names of the first poses of some rows (N,)."""
    poses = list(dict.fromkeys(rows.pose[mask]))
    more = f" and {len(poses) - SHOWN} more" if len(poses) > SHOWN else ""
    return f"pose{'s' if len(poses) > 1 else ''} {', '.join(poses[:SHOWN])}{more}"
