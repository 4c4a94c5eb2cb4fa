"""A dataset.toml of schema 2, with several instruments, and the files of their tables."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from gtpin.data.description import SCHEMA, Description, explained, read_toml
from gtpin.data.files import find_table
from gtpin.data.instrument_tables import (
    HINTS,
    NAME,
    TABLES,
    InstrumentTable,
    SocketTable,
    TiltTable,
    TrackerTable,
)
from gtpin.errors import DatasetError, warn

RESERVED = ("carts", "commands", "truth")
"""Names of tables of a dataset's folder that are no instrument's."""


class _Frame(Description):
    """A dataset.toml of schema 2, before its instruments are checked."""

    schema_: Literal["gtpin-dataset/2"] = Field(alias="schema")  # type: ignore[assignment]
    instrument: list[dict[str, Any]]  # type: ignore[assignment]


def describe_second(
    values: Mapping[str, Any], file: Path | None, own: Mapping[str, type[InstrumentTable]]
) -> tuple[Description, tuple[InstrumentTable, ...]]:
    """What a dataset.toml of schema 2 shares with schema 1, and its instruments; `DatasetError` names an invalid key.

    ``own``: classes of the tables of the user's own instruments, by kind.
    """
    if isinstance(values.get("instrument"), dict):
        hint = "write [[instrument]], in double brackets, once for each, with name and kind"
        raise DatasetError("schema 2 has a list of instruments", file=file, column="instrument", hint=hint)
    try:
        frame = _Frame.model_validate(values)
    except ValidationError as error:
        if error.errors()[0]["loc"] == ("instrument",):
            hint = "write [[instrument]] once for each, with name and kind"
            raise DatasetError("no list of instruments", file=file, column="instrument", hint=hint) from None
        raise explained(file, error) from None
    if not frame.instrument:
        raise DatasetError("no instrument", file=file, column="instrument", hint="write [[instrument]] once for each")
    kinds = {**TABLES, **own}
    tables = tuple(_instrument(i, one, file, kinds) for i, one in enumerate(frame.instrument))
    names = [table.name.lower() for table in tables]  # names of files: some file systems ignore case
    for i, table in enumerate(tables):
        column, hint = f"instrument.{i}.name", "give each a name of its own"
        if names[i] in names[:i]:
            what = f"two instruments are called {table.name}"
            raise DatasetError(what, file=file, column=column, hint=hint + ", that differs by more than case")
        if names[i] in RESERVED:
            what = f"no instrument can be called {table.name}, as another file of the folder is"
            raise DatasetError(what, file=file, column=column, hint=hint)
    shared = frame.model_dump(include={"robot", "tcp", "actuators", "tolerance", "conditions", "driver"})
    return Description.model_validate({"schema": SCHEMA, **shared}), tables


def _instrument(
    index: int, values: Mapping[str, Any], file: Path | None, kinds: Mapping[str, type[InstrumentTable]]
) -> InstrumentTable:
    place = f"instrument.{index}"
    for key in ("name", "kind"):
        if not isinstance(values.get(key), str):
            raise DatasetError(f"an instrument needs a {key}", file=file, column=f"{place}.{key}", hint=HINTS[key])
    kind = kinds.get(values["kind"])
    if kind is None:
        close = difflib.get_close_matches(values["kind"].lower(), kinds, n=1)
        hint = f"did you mean {close[0]}?" if close else f"kinds are {', '.join(kinds)}"
        raise DatasetError(f"no instrument is of kind {values['kind']!r}", file=file, column=f"{place}.kind", hint=hint)
    try:
        table = kind.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = str(first["loc"][0])
        column = ".".join([place, *(str(part) for part in first["loc"] if part != "[key]")])
        if first["type"] == "extra_forbidden":
            close = difflib.get_close_matches(key, kind.model_fields, n=1)
            hint = f"did you mean {close[0]}?" if close else f"known here: {', '.join(kind.model_fields)}"
            raise DatasetError("unknown key", file=file, column=column, hint=hint) from None
        what = "the key is missing" if first["type"] == "missing" else f"{str(first['input'])[:60]} can't be"
        usual = "a finite number, 0 or more, m or rad" if key.endswith("_sigma") else "correct the value"
        raise DatasetError(what, file=file, column=column, hint=HINTS.get(key, usual)) from None
    if isinstance(values.get("target"), (list, str)) and values.get("targets"):
        raise DatasetError("target and targets", file=file, column=f"{place}.targets", hint="write one of the two")
    if isinstance(table, TrackerTable) and table.sigma is not None and table.position_sigma is not None:
        hint = "write one of the two: they are the same"
        raise DatasetError("sigma and position_sigma", file=file, column=f"{place}.sigma", hint=hint)
    if isinstance(table, SocketTable) and bool(table.sockets) != (table.socket_sigma is not None):
        without = "sockets without socket_sigma" if table.sockets else "socket_sigma without sockets"
        hint = "give both where points are known, and neither where they are not"
        raise DatasetError(without, file=file, column=f"{place}.socket_sigma", hint=hint)
    if isinstance(table, TiltTable) and (table.target is not None or table.targets):
        column = f"{place}.{'targets' if table.targets else 'target'}"
        raise DatasetError("a tilt sensor has no target", file=file, column=column, hint="leave it out")
    for one, two, *_ in getattr(table, "distances", ()):
        if one == two:
            raise DatasetError(
                f"a distance from {one} to itself", file=file, column=f"{place}.distances", hint=HINTS["distances"]
            )
    return table


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
