"""Duplicate rows of a table: copies made by an export, which are not repeated visits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gtpin.data.dataset import Dataset
from gtpin.errors import warn

COARSE = 1e-5
"""Rounding of readings, m, from which two of them can be equal by chance; with finer readings noise makes them different."""


def counted_once(dataset: Dataset) -> Dataset:
    """The dataset without copies of rows: the same instrument and commands and, to the last digit, the same measurement.

    A copy may have another pose id, time or temperature: noise makes no two readings equal, but joining a table with another
    one repeats its rows. Where positions are rounded to 10 micrometres or more, or where a row has no number and only says that
    something was touched, visits can be equal by chance. Then rows count as copies only in a table in which every row occurs
    equally often, twice or more.

    Warns
    -----
    GtpinWarning
        Says how many copies are left out.
    """
    copies = _copies(dataset)
    if not copies.any():
        return dataset
    files = [dataset.place(int(row)) for row in np.flatnonzero(copies)]
    for file in dict.fromkeys(file for file, _ in files):
        found = [line for other, line in files if other == file]
        lines = ", ".join(map(str, found[:5])) + (", ..." if len(found) > 5 else "")
        text = (
            f"{len(found)} of {len(dataset)} rows repeat another one's commands and measurement to the last digit "
            f"(rows {lines}): copies, not repeated visits; each is counted once"
        )
        warn(f"{file}: {text}" if file else text)
    return dataset.take(~copies)


def _copies(dataset: Dataset) -> NDArray[np.bool_]:
    """(N,) rows that are copies of an earlier one."""
    readings = dataset.readings
    if readings is None:
        parts = [dataset.position] if dataset.orientation is None else [dataset.position, dataset.orientation]
        return _repeated([dataset.q, *parts], None, coarse=_coarse(dataset.position))
    copies = np.zeros(len(dataset), dtype=bool)
    for index, table in enumerate(readings.tables):
        mine = readings.rows_of(index)
        if not len(mine):
            continue
        columns = {name: column[mine] for name, column in readings.columns.items()}
        ids = np.array([column for column in columns.values() if column.dtype == object]).reshape(-1, len(mine)).T
        numbers = np.array([c for c in columns.values() if c.dtype != object], dtype=float).reshape(-1, len(mine)).T
        numbers = np.column_stack([dataset.q[mine], readings.component[mine], numbers])
        read = np.array([columns[name] for name in table.numbers], dtype=float)
        copies[mine] = _repeated([numbers], ids, coarse=not read.size or _coarse(read))
    return copies


def _repeated(
    numbers: list[NDArray[np.float64]], ids: NDArray[np.object_] | None, *, coarse: bool
) -> NDArray[np.bool_]:
    """(N,) whether a row of ``numbers``, (N, k) each, and ``ids``, (N, m), repeats an earlier row.

    If ``coarse``, rows count as repeated only where each row of the table occurs equally often.
    """
    if any(len(np.unique(column)) == len(column) for part in reversed(numbers) for column in part.T):
        return np.zeros(len(numbers[0]), dtype=bool)  # the usual case, without pandas, whose import takes long
    import pandas as pd

    table = pd.concat([pd.DataFrame(part) for part in (*numbers, *([] if ids is None else [ids]))], axis=1)
    table.columns = pd.RangeIndex(table.shape[1])
    copies = np.asarray(table.duplicated())
    if not copies.any() or not coarse:
        return copies
    times = table.groupby(list(table.columns), dropna=False).size()
    return copies if len(times) > 1 and times.min() == times.max() else np.zeros(len(table), dtype=bool)


def _coarse(position: NDArray[np.float64]) -> bool:
    """Whether all numbers, m, are multiples of `COARSE`."""
    with np.errstate(over="ignore", invalid="ignore"):
        units = position / COARSE
        return bool((np.abs(units - np.round(units)) < 1e-3).all())
