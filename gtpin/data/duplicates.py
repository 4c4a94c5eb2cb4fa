"""Duplicate rows of a table: copies made by an export, which are not repeated visits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gtpin.data.dataset import Dataset
from gtpin.errors import warn

COARSE = 1e-5
"""Readings, m, that are rounded to so much or more may agree by chance; finer ones do not, at any instrument's noise."""


def counted_once(dataset: Dataset) -> Dataset:
    """The dataset without copies of rows: the same commands and, to the last digit, the same measurement.

    A copy may have another pose id, time or temperature: an instrument never reads the same twice, and a table that is joined
    with another one repeats its rows. Where positions are rounded to 10 micrometres or more, visits can agree by chance;
    then only a table in which every row is there equally often, twice or more, holds copies.

    Warns
    -----
    GtpinWarning
        Of the copies that are left out.
    """
    copies = _copies(dataset)
    if not copies.any():
        return dataset
    lines = ", ".join(str(line) for line in dataset.row[copies][:5]) + (", ..." if copies.sum() > 5 else "")
    text = (
        f"{copies.sum()} of {len(dataset)} rows repeat another one's commands and measurement to the last digit "
        f"(rows {lines}): copies, not repeated visits; each is counted once"
    )
    warn(f"{dataset.file}: {text}" if dataset.file else text)
    return dataset.take(~copies)


def _copies(dataset: Dataset) -> NDArray[np.bool_]:
    """(N,) rows that are copies of an earlier one."""
    import pandas as pd

    parts = [dataset.q, dataset.position]
    if dataset.orientation is not None:
        parts.append(dataset.orientation)
    table = pd.DataFrame(np.hstack(parts))
    copies = np.asarray(table.duplicated())
    if not copies.any() or not _coarse(dataset.position):
        return copies
    times = table.groupby(list(table.columns)).size()
    return copies if len(times) > 1 and times.min() == times.max() else np.zeros(len(table), dtype=bool)


def _coarse(position: NDArray[np.float64]) -> bool:
    with np.errstate(over="ignore", invalid="ignore"):
        units = position / COARSE
        return bool((np.abs(units - np.round(units)) < 1e-3).all())
