"""Files of a dataset of several instruments: which file is the table of which instrument, and how their rows are joined."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gtpin.data.description import read_toml
from gtpin.data.files import find_table
from gtpin.data.ids import Ids
from gtpin.data.instrument_tables import NAME, InstrumentTable
from gtpin.data.second_schema import RESERVED
from gtpin.data.table import Column
from gtpin.errors import DatasetError, warn
from gtpin.typing import Floats


def tables_there(folder: Path) -> list[str]:
    """Names of the files that the tables of a folder's instruments may have by default; none where dataset.toml lists none."""
    try:
        found = read_toml(folder / "dataset.toml").get("instrument")
    except DatasetError:
        return []
    names = [str(one.get("name")) for one in found if isinstance(one, dict)] if isinstance(found, list) else []
    return [f"{name}.{kind}" for name in names if re.fullmatch(NAME, name) for kind in ("csv", "parquet")]


def file_of(path: Path, index: int, table: InstrumentTable) -> Path:
    """File of the table of the instrument with this index; raises `DatasetError` where it is missing or outside the folder."""
    place = f"instrument.{index}.file"
    toml = path / "dataset.toml"
    if table.file is None:
        file = find_table(path, table.name)
        if file is None:
            what, hint = f"there is no table of {table.name}", f"put {table.name}.csv beside it, or name it: file = ..."
            raise DatasetError(what, file=toml, column=place, hint=hint)
        return file
    file = path / table.file
    if os.path.isabs(table.file) or ".." in Path(table.file).parts:
        raise DatasetError("a file outside the folder", file=toml, column=place, hint="move it in")
    if not file.is_file():
        raise DatasetError(f"there is no {table.file}", file=toml, column=place, hint="check its name")
    return file


def columns_beside(toml: Path, index: int, tables: tuple[InstrumentTable, ...], files: list[Path]) -> set[str]:
    """Columns of the same file that other instruments use; raises `DatasetError` where this instrument uses them too."""
    found: set[str] = set()
    for i, other in enumerate(tables):
        if i == index or files[i] != files[index]:
            continue
        if other.kind == tables[index].kind or set(other.numbers) & set(tables[index].numbers):
            what = f"{other.name} and {tables[index].name} read the same columns of {files[i].name}"
            hint = "give each instrument a table of its own"
            raise DatasetError(what, file=toml, column=f"instrument.{max(i, index)}.file", hint=hint)
        found |= {*other.numbers, *other.optional, *other.ids}
    return found


def warn_of_files(path: Path, used: set[str]) -> None:
    """Warn of tables in a folder that no instrument uses; ``used``: names of those that are used."""
    try:
        there = sorted(file.name for file in path.iterdir() if file.suffix.lower() in (".csv", ".parquet"))
    except OSError:
        return
    left = [name for name in there if name not in used and Path(name).stem not in RESERVED]
    if left:
        warn(f"{path}: {', '.join(left)}: tables without an [[instrument]] in dataset.toml, ignored")


@dataclass(frozen=True, eq=False)
class TablePart:
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


def filled(part: TablePart, name: str, parts: list[TablePart]) -> Column:
    """(N,) column ``name`` of one instrument's readings; full of NaN, or "" for ids, where the instrument does not have it."""
    if name in part.readings:
        return part.readings[name]
    of = next(p.readings[name] for p in parts if name in p.readings)
    if of.dtype == object:
        empty = np.empty(len(part.pose), dtype=object)
        empty[:] = ""
        return empty
    return np.full(len(part.pose), np.nan)


def covariates_of(toml: Path, parts: list[TablePart]) -> dict[str, Column]:
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
