"""The files of a dataset's folder: which table is whose, and all of them written at once."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from gtpin.data.description import Description, read_toml, write_description
from gtpin.data.files import find_table, write_table
from gtpin.data.instrument_tables import NAME, RESERVED, InstrumentTable
from gtpin.data.table import Column
from gtpin.errors import DatasetError, warn
from gtpin.output.ownership import refuse_foreign, was_moved_aside
from gtpin.output.results import results_folder, writing

SUFFIXES = ("csv", "parquet")
FILES = ("dataset.toml", "poses.csv", "poses.parquet", "carts.csv", "carts.parquet")
"""Names of the files of a dataset's folder."""


def write_folder(
    folder: Path,
    description: Description,
    instruments: Sequence[Mapping[str, Any]],
    tables: Mapping[str, Mapping[str, Column]],
    suffix: str = "csv",
    *,
    old: Iterable[str] = (),
    force: bool = False,
) -> None:
    """Write the folder of a dataset completely, or not at all; see :meth:`~gtpin.data.dataset.Dataset.write`.

    ``instruments``: the ``[[instrument]]`` sections of schema 2. ``tables``: (N,) columns by name of the table. ``old``: names
    of other tables that go.
    """
    if not force and folder.is_dir():
        with writing(folder, DatasetError):
            names = (name for name in sorted(os.listdir(folder)) if not was_moved_aside(name))
            refuse_foreign(folder, names, force, DatasetError)
    own = (f"{name}.{ending}" for name in tables for ending in SUFFIXES)
    with results_folder(folder, tuple(dict.fromkeys((*FILES, *old, *own))), force=force, kind=DatasetError) as new:
        write_description(new / "dataset.toml", description, instruments)
        for name, columns in tables.items():
            write_table(new / f"{name}.{suffix}", columns)


def tables_there(folder: Path) -> list[str]:
    """Names of the files that the tables of a folder's instruments may have by default; none where dataset.toml lists none."""
    try:
        found = read_toml(folder / "dataset.toml").get("instrument")
    except DatasetError:
        return []
    names = [str(one.get("name")) for one in found if isinstance(one, dict)] if isinstance(found, list) else []
    return [f"{name}.{suffix}" for name in names if re.fullmatch(NAME, name) for suffix in SUFFIXES]


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
