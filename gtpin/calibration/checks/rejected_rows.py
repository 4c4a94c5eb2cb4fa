"""Which readings a fit has set aside: in words that say which instrument, and which station, plane, socket or target."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset
from gtpin.errors import DatasetError, warn
from gtpin.instruments.readings import Readings

Mask = npt.NDArray[np.bool_]

MOST = 0.5
"""Share of an instrument's rows that gross errors make at most; beyond it nobody can say which the errors are."""
SEVERAL = 3
"""Readings of one id from which most of them can be off together."""
SHOWN = 10
"""Poses that a warning names."""


def check_used(kept: Dataset, readings: Readings, used: Mask) -> None:
    """Refuse an instrument of which most rows were set aside, and warn of those of others.

    Parameters
    ----------
    kept, readings
        The rows that were fitted.
    used
        (N,) those that are no gross errors.

    Raises
    ------
    DatasetError
        With the instrument.

    Warns
    -----
    GtpinWarning
        Of poses by name; of a station, a plane, a socket or a target of which most readings were set aside.
    """
    for i, one in enumerate(readings.instruments):
        mine = readings.rows.of == i
        share = float((~used[mine]).mean()) if mine.any() else 0.0
        if share > MOST:
            raise DatasetError(
                f"{100.0 * share:.0f} % of the readings of {one.name} do not fit the others",
                file=readings.rows.files[i],
                hint="check its units, its rows' commands, and where it stood",
            )
    for i in range(len(readings.instruments)):
        for text in _off_together(readings, used, i):
            warn(text)
    if not used.all():
        warn(f"set aside as gross errors: {poses_of(kept.pose[~used])}")


def poses_of(ids: npt.NDArray[np.object_]) -> str:
    """Some poses by name."""
    names = list(dict.fromkeys(map(str, ids)))
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"poses {', '.join(names[:SHOWN])}{more}"


def _off_together(readings: Readings, used: Mask, index: int) -> Iterator[str]:
    """Ids of an instrument of which most readings were set aside, in words."""
    rows, file = readings.rows, readings.rows.files[index]
    mine = rows.rows_of(index)
    for column in rows.tables[index].ids:
        if len(rows.known[index].get(column, ())) < 2:
            continue
        ids = rows.columns[column][mine]
        for name in rows.known[index][column]:
            own = np.unique(rows.line[mine[ids == name]])
            lost = np.unique(rows.line[mine[(ids == name) & ~used[mine]]])
            if len(own) >= SEVERAL and len(lost) > MOST * len(own):
                where = "" if file is None else f"{Path(file)}: "
                text = (
                    f"{len(lost)} of {len(own)} readings of {rows.tables[index].name} with {column} {name} do not fit"
                )
                yield f"{where}{text} the others: check what dataset.toml declares of it, and these rows"
