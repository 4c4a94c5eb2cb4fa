"""The border: numbers that can't be of a machine's sensors, and what an export did to a table: copies of rows, which are no
visits, and positions rounded more coarsely than the noise."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc

from gtpin.data.commands import Commands
from gtpin.data.dataset import Dataset
from gtpin.data.files import warn_of
from gtpin.data.ids import joint_codes
from gtpin.data.names import POSITION
from gtpin.errors import DatasetError, listed
from gtpin.typing import Floats, Indices, Mask

MOST_IMPOSSIBLE = 0.1
"""Share of the rows that may lack a reading before the column is refused; assumed."""
_OVERFLOW = (-999.0, -9999.0, -99999.0, 9999.0, 99999.0, 65535.0, 32767.0, -32768.0, 2147483647.0, 4294967295.0)


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


POSITION_STEPS = (1e-2, 5e-3, 1e-3, 5e-4, 1e-4, 5e-5, 1e-5)
"""Steps that positions are rounded to, m, the coarsest first."""
COMMAND_STEPS = (0.1, 0.05, *POSITION_STEPS)
"""Steps that commands are rounded to, m or rad, the coarsest first."""
DEGREE_STEPS = (1.0, 0.5, 0.1, 0.05, 0.01, 0.005, 0.001)
"""The same for joints that turn, degrees: as controllers show them. Assumed."""
EXACT = 1e-6
"""Share of a step by which a number may differ from a multiple of it: binary numbers don't represent decimals exactly."""


def with_rounding(dataset: Dataset) -> Dataset:
    """The dataset with the rounding error added to the declared noise of positions.

    Rounding to a step d is an error uniform over d, of standard deviation d / sqrt(12). Undeclared noise is estimated from
    the data, and includes it already.

    Warns: where rounding makes the noise larger than what is declared.
    """
    step, declared = coarsest_step(dataset.position, POSITION_STEPS), dataset.instrument.position_sigma
    if step is None or declared is None:
        return dataset
    sigma = float(np.hypot(declared, step / np.sqrt(12.0)))
    if sigma < 1.05 * declared:
        return dataset
    text = (
        f"positions are rounded to {1e3 * step:g} mm: with it their noise is {sigma:.2g} m, more than the {declared:.2g} m "
        "that are declared, and is used; export more digits"
    )
    warn_of(dataset.file, text)
    return replace(dataset, instrument=dataset.instrument.model_copy(update={"position_sigma": sigma}))


def coarsest_step(values: Floats, steps: Sequence[float]) -> float | None:
    """The first of some steps that all values (N, k) are multiples of; None where there is none, or there are few rows."""
    near = values[(np.abs(values) < 1e3).all(axis=1)]  # without gross errors
    if len(near) < 10:
        return None
    for step in steps:
        counts = near / step
        if np.abs(counts - np.round(counts)).max() < EXACT:
            return step
    return None


class CommandSteps(NamedTuple):
    """Steps that commands are multiples of: ``size`` (n,), m or rad, infinite for a command that is constant; ``words``."""

    size: Floats
    words: str


def command_steps(q: Floats, revolute: Mask) -> CommandSteps | None:
    """The coarsest steps that each of the commands q (N, n), m or rad, is a multiple of; None where one has no step.

    ``revolute``: (n,) whether an actuator turns; all that do have steps in rad, or all in degrees.
    """
    for unit, steps, factor in (("rad", COMMAND_STEPS, 1.0), ("degrees", DEGREE_STEPS, np.pi / 180.0)):
        sizes, words = np.full(q.shape[1], np.inf), list[str]()
        for j in np.flatnonzero(np.ptp(q, axis=0) > 0.0):
            own = (unit, steps, factor) if revolute[j] else ("m", COMMAND_STEPS, 1.0)
            step = coarsest_step(q[:, [j]] / own[2], own[1])
            if step is None:
                break
            sizes[j] = step * own[2]
            words.append(f"{step:g} {own[0]}")
        else:
            return CommandSteps(sizes, " or ".join(dict.fromkeys(words))) if words else None
    return None


STEPS = tuple(m * 10.0**-k for k in range(2, 10) for m in (1.0, 0.5))
"""Steps that readings are rounded to, m or rad, the coarsest first."""
FINEST = 1e-12
"""Step of readings with all digits of a binary number, m or rad."""


def counted_once(dataset: Dataset) -> Dataset:
    """The dataset without copies of rows: see :func:`copies`.

    Warns: says how many copies are left out.
    """
    found = copies(dataset)
    if not found.any():
        return dataset
    files = [dataset.place(int(row)) for row in np.flatnonzero(found)]
    for file in dict.fromkeys(file for file, _ in files):
        lines_here = [line for other, line in files if other == file]
        lines = ", ".join(map(str, lines_here[:5])) + (", ..." if len(lines_here) > 5 else "")
        text = (
            f"{len(lines_here)} of {len(dataset)} rows repeat another one's commands and measurement to the last digit "
            f"(rows {lines}): copies, not repeated visits; each is counted once"
        )
        warn_of(file, text)
    return dataset.take(~found)


def copies(dataset: Dataset) -> NDArray[np.bool_]:
    """(N,) rows that are copies of an earlier one.

    Equal rows have the same instrument, commands and time, and to the last digit the same measurement. Other covariates may
    differ, because joining a table with another one repeats its rows. Rounded readings of repeated visits are equal by chance,
    too. Equal rows are copies in two cases: there are more of them than chance allows, given the step of the readings and
    their scatter between visits; or every row of the table is there twice, or three times, and so on.
    """
    time = [dataset.covariates["time"]] if "time" in dataset.covariates else []
    readings = dataset.readings
    found = np.zeros(len(dataset), dtype=bool)
    for index in range(len(readings.tables)):
        mine = readings.rows_of(index)
        columns = [column[mine] for column in readings.columns.values()]
        ids = [column.astype(str) for column in columns if column.dtype == object]
        read = [column for column in columns if column.dtype != object and not np.isnan(column).any()]
        same = [*dataset.q[mine].T, *(column[mine] for column in time), readings.component[mine], *ids]
        found[mine] = _copies(same, read)
    return found


def _copies(same: list[NDArray[np.generic]], read: list[Floats]) -> NDArray[np.bool_]:
    """(N,) which rows are copies of an earlier one.

    ``same``: (N,) each: columns that two visits to one place have in common, such as commands. ``read``: (N,) each: columns
    of what was measured.
    """
    count = len(same[0])
    copied = np.zeros(count, dtype=bool)
    if any(len(np.unique(column)) == count for column in (*read, *same)):
        return copied  # the usual case
    place = joint_codes(same)
    row = joint_codes([place, *read])
    order = np.argsort(row, kind="stable")
    begins = np.flatnonzero(np.diff(row[order], prepend=-1))
    times = np.diff(begins, append=count)
    if times.max(initial=1) == 1:
        return copied
    # How many equal rows there are before each: a whole table that is there k times has k copies of every row.
    earlier = np.empty(count, dtype=np.intp)
    earlier[order] = np.arange(count) - np.repeat(begins, times)
    whole = int(np.gcd.reduce(times))
    if whole > 1 and len(times) > 1:
        each = np.empty(count, dtype=np.intp)
        each[order] = np.repeat(times // whole, times)
        copied = earlier >= each
    repeated = (earlier > 0) & ~copied
    visits = np.bincount(place[~copied])
    pairs = float((visits * (visits - 1)).sum()) / 2.0
    equal = int(repeated.sum())
    if equal and betainc(equal, pairs - equal + 1.0, _chance(place, row, read)) < 1e-5:
        copied |= repeated
    return copied


def _chance(place: Indices, row: Indices, read: list[Floats]) -> float:
    """Upper bound of the probability that two visits to one place are equal in all columns: that of the most unlikely column.

    Columns are not multiplied, because the errors of a drive move several of them together.
    """
    order = np.argsort(place, kind="stable")
    visits = np.flatnonzero((np.diff(place[order]) == 0) & (np.diff(row[order]) != 0))
    visits = visits[:: 1 + len(visits) // 1000]
    chances = [1.0]
    for column in read:
        moved = np.abs(column[order][visits + 1] - column[order][visits])
        moved = moved[moved > 0.0]
        step = _step(column, moved)
        if len(moved):
            chances.append(_equal(moved / step))
        elif not len(visits) and (column != column[0]).any():
            chances.append(min(1.0, step / 1e-6))  # few machines repeat to less, m or rad
    return min(chances)


def _step(column: Floats, moved: Floats) -> float:
    """The step to which a column is rounded, given differences between visits: one that these show, or a decimal one."""
    if len(moved) >= 5:  # a step of their own, such as that of inches
        for part in (1.0, 2.0, 3.0):
            steps = moved * (part / moved.min())
            if (np.abs(steps - np.round(steps)) < 1e-3).all():
                return float(moved.min() / part)
    return coarsest_step(column[:, None], STEPS) or FINEST


def _equal(steps: Floats) -> float:
    """Upper bound of the probability that two visits are equal in a column, from k differences of those that are not, in steps.

    Readings of scatter s, rounded to steps that are smaller, are equal with probability 1 / (2 sqrt(pi) s), and their
    differences have the median 0.95 s. A median of k has a relative standard error of about 1 / sqrt(k). Of a scatter up to
    two steps nothing is known.
    """
    middle = float(np.median(steps))
    return 1.0 if middle < 2.5 else min(1.0, (0.27 + 1.0 / np.sqrt(len(steps))) / middle)
