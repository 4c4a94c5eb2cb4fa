"""What an export did to a table: positions rounded more coarsely than the noise, and copies of rows, which are no visits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc

from gtpin.data.dataset import Dataset
from gtpin.data.files import warn_of
from gtpin.data.ids import joint_codes
from gtpin.typing import Floats, Indices, Mask

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
