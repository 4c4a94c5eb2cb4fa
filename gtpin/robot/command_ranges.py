"""Commands of a robot's actuators, compared with their ranges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from gtpin.data import Commands, Dataset
from gtpin.data.files import warn_of
from gtpin.data.plausible import named_poses
from gtpin.errors import DatasetError, warn
from gtpin.robot.constrained_model import ConstrainedModel
from gtpin.typing import Mask

Doubt = Callable[[DatasetError, Any], None]
"""Decides on a suspected mistake, by its error and the rows without the mistake: it raises the error, or returns."""

_NEARLY_ALL = 0.95
"""Share of a column's values that must fit another unit for the message that they look like it. Assumed."""
Rows = TypeVar("Rows", Dataset, Commands)


def without_whole_turns(rows: Rows, drives: ConstrainedModel) -> Rows:
    """The rows with commands outside their ranges less a whole turn, in columns that fit their ranges then.

    A controller may count from 0 to 360 degrees where the robot's file has a range about 0. Columns with values that are
    more than a turn off the range, as degrees are, stay as they are.

    Warns: names the column and the number of rows.
    """
    low, high = drives.lower, drives.upper
    turns = drives.revolute & np.isfinite(high - low)
    if rows.n_actuators != len(low) or not turns.any():
        return rows
    middle, half = np.where(turns, (low + high) / 2.0, 0.0), np.where(turns, (high - low) / 2.0, np.inf)
    off = rows.q - middle
    whole = np.where(turns & (np.abs(off) > half), np.round(off / (2.0 * np.pi)), 0.0)
    inside = np.abs(off - 2.0 * np.pi * whole) <= half
    # Controllers count from 0 to 360 degrees or to either side; commands in degrees are farther off than one turn.
    whole[:, (inside.mean(axis=0) < _NEARLY_ALL) | (np.abs(off) > 2.0 * np.pi + half).any(axis=0)] = 0.0
    whole[~inside] = 0.0
    if not whole.any():
        return rows
    q = rows.q - 2.0 * np.pi * whole
    for j in map(int, np.flatnonzero(whole.any(axis=0))):
        first, count = int(np.argmax(whole[:, j] != 0.0)), int(np.count_nonzero(whole[:, j]))
        warn_of(
            rows.file,
            f"q{j + 1}: a whole turn is taken off in {count} of {len(q)} rows, since {drives.sites[j]} turns from "
            f"{low[j]:g} to {high[j]:g} rad (in row {rows.place(first)[1]}, {rows.q[first, j]:g} becomes {q[first, j]:.6g})",
        )
    return replace(rows, q=q)


def check_actuators(drives: ConstrainedModel, rows: Dataset | Commands) -> None:
    """Raise `DatasetError` where rows do not have one command for each of a robot's actuators."""
    given, needed = rows.n_actuators, len(drives.sites)
    if given != needed:
        what = f"{given} command{'s'[: given != 1]} a pose, but {drives.name} has {needed} actuator{'s'[: needed != 1]}"
        hint = f"give {'q1' if needed == 1 else f'q1 .. q{needed}'} ({', '.join(drives.sites)})"
        hint += ", or name those that were commanded: actuators = [...] in dataset.toml" if given < needed else ""
        raise DatasetError(what, file=rows.file, column=f"q{given}", hint=hint)


def check_commands(rows: Dataset | Commands, drives: ConstrainedModel, suspect: Doubt | None = None) -> None:
    """Check commands against the ranges of a robot's n actuators.

    ``suspect``: what is done where most commands of a joint without limits are more than three turns from zero, as
    degrees are; None: the error is raised.

    Raises `DatasetError` for another number of actuators, and for a command that is outside its range by more than the range's
    width, with the unit that it looks like; of a trusted dataset it only warns. Warns of poses that are outside by less.
    """
    names, low, high, q = drives.sites, drives.lower, drives.upper, rows.q
    check_actuators(drives, rows)
    beyond = np.maximum(low - q, q - high)
    far = beyond > high - low
    if far.any():
        error = _far_outside(rows, drives, far)
        if not getattr(rows, "trusted", False):
            raise error
        warn(str(error))
    turn = 2.0 * np.pi
    for j in map(int, np.flatnonzero(drives.revolute & ~np.isfinite(high - low))):
        size = np.abs(q[:, j])
        many = size > 3.0 * turn
        if many.mean() > 0.5 and (np.deg2rad(size) <= turn).mean() >= _NEARLY_ALL:  # nearly all within 360 degrees
            what = f"most commands of {names[j]} are more than 3 turns from zero, and look like degrees"
            hint = "write commands in rad; if the joint did turn so often, take whole turns away"
            file, line = rows.place(int(np.argmax(many)))
            error = DatasetError(what, file=file, row=line, column=f"q{j + 1}", hint=hint)
            if suspect is None:
                raise error
            suspect(error, replace(rows, q=np.where(np.arange(q.shape[1]) == j, np.deg2rad(q), q)))
    width = np.where(np.isfinite(high - low), high - low, 0.0)
    outside = np.asarray((beyond > 1e-9 * width).any(axis=1))
    if outside.any():
        warn_of(rows.file, f"commands a little outside the robot's range: {named_poses(rows, outside)}")


def _far_outside(rows: Dataset | Commands, drives: ConstrainedModel, far: Mask) -> DatasetError:
    """The error of the first command that is ``far`` (N, n) outside its range, with the unit that its column looks like."""
    index, j = (int(i) for i in np.argwhere(far)[0])
    name, low, high, q = drives.sites[j], drives.lower[j], drives.upper[j], rows.q[:, j]
    right, other, factor = ("rad", "degrees", 180.0 / np.pi) if drives.revolute[j] else ("m", "millimetres", 1000.0)
    as_is, scaled = (((x >= low) & (x <= high)) for x in (q, q / factor))
    looks, hint = "", "correct the row, or leave it out"
    # Where most commands fit without a conversion, the others are separate errors, not a matter of units.
    if scaled.mean() >= _NEARLY_ALL and as_is.mean() < 0.5:
        looks, hint = f", and the column looks like {other}", f"write commands in {right}"
    elif (own := far[:, j]).sum() >= 6 and scaled[own].mean() >= _NEARLY_ALL:
        lines = [rows.place(int(i))[1] for i in np.flatnonzero(own)]
        looks = f", and so are {len(lines)} of {len(q)} rows, the first in line {min(lines)} and the last in line "
        looks += f"{max(lines)} of the file, which look like {other}"
        hint = f"write commands of these rows in {right}"
    what = f"{q[index]:g} is far outside the range of {name} ({low:g} to {high:g} {right}){looks}"
    file, line = rows.place(index)
    return DatasetError(what, file=file, row=line, column=f"q{j + 1}", hint=hint)
