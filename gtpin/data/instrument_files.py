"""Files of a dataset of several instruments: which file is the table of which instrument."""

from __future__ import annotations

import os
import re
from pathlib import Path

from gtpin.data.description import read_toml
from gtpin.data.files import find_table
from gtpin.data.instrument_tables import NAME, InstrumentTable
from gtpin.data.second_schema import RESERVED
from gtpin.errors import DatasetError, warn


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
