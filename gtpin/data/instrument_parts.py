"""Rows of one instrument, and how the columns of several become those of all rows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gtpin.data.ids import Ids
from gtpin.data.instrument_tables import InstrumentTable
from gtpin.data.table import Column
from gtpin.errors import warn
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class Part:
    """The rows of one instrument.

    - ``table``, ``file``: its section of dataset.toml, and the file of its table.
    - ``line``: (N,) line of each row.
    - ``pose``, ``q``: (N,) ids, and (N, n) commands, m or rad.
    - ``readings``, ``covariates``: columns of its kind of instrument, and all other columns: (N,) each, by name.
    """

    table: InstrumentTable
    file: Path
    line: NDArray[np.int64]
    pose: Ids
    q: Floats
    readings: dict[str, Column]
    covariates: dict[str, Column]


def filled(part: Part, name: str, parts: list[Part]) -> Column:
    """(N,) column ``name`` of one instrument's readings; full of NaN, or "" for ids, where the instrument does not have it."""
    if name in part.readings:
        return part.readings[name]
    of = next(p.readings[name] for p in parts if name in p.readings)
    if of.dtype == object:
        empty = np.empty(len(part.pose), dtype=object)
        empty[:] = ""
        return empty
    return np.full(len(part.pose), np.nan)


def covariates_of(toml: Path, parts: list[Part]) -> dict[str, Column]:
    """Covariates of all rows, by name.

    A table without the column takes the values of other tables at the same poses. Where those do not have all its poses, the
    covariate is left out, with a warning.
    """
    names = dict.fromkeys(name for part in parts for name in part.covariates)
    found: dict[str, Column] = {}
    lost: list[str] = []
    for name in names:
        of_pose: dict[str, object] = {}
        for part in parts:
            if name in part.covariates:
                for pose, value in zip(part.pose, part.covariates[name], strict=True):
                    of_pose.setdefault(pose, value)
        values: list[object] = []
        for part in parts:
            if name in part.covariates:
                values += list(part.covariates[name])
            elif all(pose in of_pose for pose in part.pose):
                values += [of_pose[pose] for pose in part.pose]
            else:
                lost.append(f"{name} (not in {part.file.name})")
                break
        else:
            column: Column = np.array(values, dtype=object if name == "session" else float)
            column.setflags(write=False)
            found[name] = column
    if lost:
        warn(f"{toml.parent}: covariates that only some tables have are left out: {', '.join(lost)}")
    return found
