"""Numbers that can't be: commands of a robot's actuators, readings of a machine's sensors, values of dataset.toml."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar

import numpy as np

from gtpin.data.commands import Commands
from gtpin.data.dataset import Dataset
from gtpin.data.files import warn_of
from gtpin.data.names import POSITION
from gtpin.errors import DatasetError, listed, warn
from gtpin.typing import Floats, Mask

Doubt = Callable[[DatasetError, Any], None]
"""Decides on a suspected mistake, by its error and the rows without the mistake: it raises the error, or returns."""

_NEARLY_ALL = 0.95
"""Share of a column's values that must fit another unit for the message that they look like it. Assumed."""
MOST_IMPOSSIBLE = 0.1
"""Share of the rows that may lack a reading before the column is refused; assumed."""
_OVERFLOW = (-999.0, -9999.0, -99999.0, 9999.0, 99999.0, 65535.0, 32767.0, -32768.0, 2147483647.0, 4294967295.0)


class Actuated(Protocol):
    """A robot with n actuators."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def sites(self) -> tuple[str, ...]:
        """Names of its actuators, in the order of q."""

    @property
    def lower(self) -> Floats:
        """(n,) lower end of each range, m or rad."""

    @property
    def upper(self) -> Floats:
        """(n,) upper end of each range, m or rad."""

    @property
    def revolute(self) -> Mask:
        """(n,) whether each one turns."""


Rows = TypeVar("Rows", Dataset, Commands)


def without_whole_turns(rows: Rows, drives: Actuated) -> Rows:
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


def check_actuators(drives: Actuated, rows: Dataset | Commands) -> None:
    """Raise `DatasetError` where rows do not have one command for each of a robot's actuators."""
    given, needed = rows.n_actuators, len(drives.sites)
    if given != needed:
        what = f"{given} command{'s'[: given != 1]} a pose, but {drives.name} has {needed} actuator{'s'[: needed != 1]}"
        hint = f"give {'q1' if needed == 1 else f'q1 .. q{needed}'} ({', '.join(drives.sites)})"
        hint += ", or name those that were commanded: actuators = [...] in dataset.toml" if given < needed else ""
        raise DatasetError(what, file=rows.file, column=f"q{given}", hint=hint)


def check_commands(rows: Dataset | Commands, drives: Actuated, suspect: Doubt | None = None) -> None:
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


def _far_outside(rows: Dataset | Commands, drives: Actuated, far: Mask) -> DatasetError:
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


def named_poses(rows: Dataset | Commands, mask: Mask) -> str:
    """Text for a message with the names of the first poses of some rows (N,)."""
    poses = list(dict.fromkeys(rows.pose[mask]))
    return f"pose{'s'[: len(poses) - 1]} {listed(poses, 10)}"


@dataclass(frozen=True)
class Kind:
    """What a column measures.

    - ``names``: its columns.
    - ``what``: what it is and its unit, for messages.
    - ``lowest``, ``highest``: limits of the values of any machine. Assumed.
    - ``marks``: values that loggers write where they have no reading. They count as marks where no other value is near
      them.
    - ``apart``: smallest distance of a mark from all other values, in the column's unit. It must also be at least ``spans``
      times the range of the other values.
    """

    names: re.Pattern[str]
    what: str
    lowest: float
    highest: float
    marks: tuple[float, ...]
    apart: float
    spans: float = 1.0


KINDS = (
    # 85 degC is a DS18B20's value at power-up, -127 degC is its library's error; 0 and -273.15 are 0 counts and 0 K.
    Kind(re.compile("temp.*"), "a temperature in degC", -60.0, 150.0, (0.0, 85.0, 127.0, -127.0, *_OVERFLOW), 5.0),
    Kind(re.compile("speed[0-9]+"), "a speed in m/s or rad/s", -20.0, 20.0, _OVERFLOW, 10.0),
    Kind(re.compile("payload"), "a payload in kg", 0.0, 1e5, (65535.0, 32767.0, 9999.0, 99999.0), 1e3),
    Kind(re.compile("f[xyz]"), "a force in N", -1e6, 1e6, _OVERFLOW, 500.0),
    Kind(re.compile("time"), "a time in s", -1e20, 1e20, (0.0, -1.0, *_OVERFLOW), 60.0, 10.0),
    Kind(re.compile(".*"), "a number that can be counted with", -1e100, 1e100, (), np.inf),
)
"""Kinds of columns; the first one whose pattern matches a column's name applies."""


def sane_rows(dataset: Dataset) -> Mask:
    """(N,) the rows without an impossible value.

    Raises `DatasetError` if a temperature looks like kelvin or Fahrenheit, or a speed like mm/s; if more than a tenth of a
    column is impossible. Warns: names the poses that are set aside.
    """
    good = np.ones(len(dataset), dtype=bool)
    for name, column in dataset.covariates.items():
        if name == "session":
            continue
        kind = next(kind for kind in KINDS if kind.names.fullmatch(name))
        values = np.asarray(column, dtype=float)
        _check_units(dataset, name, values)
        lacking = _lacking(values, kind)
        if lacking.mean() > MOST_IMPOSSIBLE:
            first = int(np.argmax(lacking))
            hint = f"{lacking.sum()} of {len(values)} rows are like that: give them as {kind.what}, or leave the column out"
            file, line = dataset.place(first)
            what = f"{values[first]:.6g} can't be {kind.what}"
            raise DatasetError(what, file=file, row=line, column=name, hint=hint)
        if lacking.any():
            shown = ", ".join(f"{value:g}" for value in np.unique(values[lacking])[:3])
            poses = ", ".join(dataset.names_of(lacking))
            warn_of(dataset.file, f"set aside, for {name} of {shown} is no reading: poses {poses}")
            good &= ~lacking
    return good


def _lacking(values: Floats, kind: Kind) -> Mask:
    """(N,) True for impossible values, and for marks of loggers that are far from all other values."""
    lacking = (values < kind.lowest) | (values > kind.highest)
    marked = np.isin(values, kind.marks) & ~lacking
    others = values[~lacking & ~marked]
    if not marked.any() or not len(others) or marked.mean() > MOST_IMPOSSIBLE:
        return lacking
    low, high = float(others.min()), float(others.max())
    apart = np.maximum(low - values, values - high)
    return lacking | (marked & (apart > max(kind.apart, kind.spans * (high - low))))


def _check_units(dataset: Dataset, name: str, values: Floats) -> None:
    middle = float(np.median(values))

    def looks(unit: str, hint: str) -> DatasetError:
        return DatasetError(f"{name} looks like {unit}", file=dataset.file, column=name, hint=hint)

    if name.startswith("temp"):
        if -40.0 <= middle - 273.15 <= 90.0:
            raise looks("kelvin", f"subtract 273.15 from {name}")
        reference = dataset.conditions.reference_temperature
        if middle > max(45.0, reference + 25.0) and 10.0 <= (middle - 32.0) / 1.8 <= 40.0:
            hint = (
                f"{name} = ({name} - 32) / 1.8; a machine that is as warm as that has a reference_temperature near it, "
                "under [conditions]"
            )
            raise looks("degrees Fahrenheit", hint)
    if re.fullmatch("speed[0-9]+", name):
        moving = np.abs(values[values != 0.0])
        if len(moving) and 20.0 < float(np.median(moving)) <= 2e4:
            raise looks("mm/s or degrees/s", "speeds are in m/s or rad/s")


def check_extremes(dataset: Dataset) -> None:
    """Check that positions have a unit, and that the commands differ.

    Raises `DatasetError` for positions beyond any unit, and where all commands are the same. Warns: of a reference temperature
    that could be in degrees Fahrenheit.
    """
    if 59.0 <= (reference := dataset.conditions.reference_temperature) <= 86.0:  # 15 to 30 degC
        text = f"reference_temperature is taken as {reference:g} degC; where it is in degrees Fahrenheit, convert it"
        warn_of(dataset.toml, text)
    for name, size in zip(POSITION, np.median(np.abs(dataset.position), axis=0), strict=True):
        if size > 1e12:  # in nanometres, 1 km
            what, hint = f"half of the positions are {size:.2g} m away or farther", "give metres"
            raise DatasetError(what, file=dataset.file, column=name, hint=hint)
    if len(dataset) > 1 and not np.ptp(dataset.q, axis=0).any():
        hint = "calibration needs poses all over the workspace"
        raise DatasetError("all poses have the same commands", file=dataset.place(0)[0], column="q1", hint=hint)
