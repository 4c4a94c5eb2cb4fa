"""Messages on readings that a fit has set aside: of which instrument, station, plane, socket or target they are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.calibration.checks.suspected import refuse
from gtpin.data import Dataset
from gtpin.errors import DatasetError, warn
from gtpin.instruments.readings import Readings
from gtpin.typing import Mask

MOST = 0.5
"""Largest share of gross errors among an instrument's rows; above it, it is not clear which rows are the errors. Assumed."""
SEVERAL = 3
"""Fewest readings of one id for a message that most of them were set aside. Assumed."""
SHOWN = 10
"""Largest number of poses that a warning names."""


def check_used(kept: Dataset, readings: Readings, used: Mask) -> None:
    """Refuse an instrument with most of its rows set aside; warn of rows of other instruments that were set aside.

    ``kept``, ``readings``: the rows that were fitted. ``used``: (N,) the rows that are no gross errors.

    Raises `DatasetError` if there is such an instrument; the error names it. Warns: names the poses with such rows, and a
    station, plane, socket or target with most of its readings set aside.
    """
    for i, one in enumerate(readings.instruments):
        mine = readings.rows.of == i
        share = float((~used[mine]).mean()) if mine.any() else 0.0
        if share > MOST:
            error = DatasetError(
                f"{100.0 * share:.0f} % of the readings of {one.name} do not fit the others",
                file=readings.rows.files[i],
                hint="check its units, its rows' commands, and where it stood",
            )
            refuse(error, kept)
    for i in range(len(readings.instruments)):
        for text in _off_together(readings, used, i):
            warn(text)
    if not used.all():
        warn(f"set aside as gross errors: {poses_of(kept.pose[~used])}")


def poses_of(ids: npt.NDArray[np.object_]) -> str:
    """Text for a message with the names of the first poses."""
    names = list(dict.fromkeys(map(str, ids)))
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"poses {', '.join(names[:SHOWN])}{more}"


def _off_together(readings: Readings, used: Mask, index: int) -> Iterator[str]:
    """Texts for warnings: ids of an instrument of which most readings were set aside."""
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
