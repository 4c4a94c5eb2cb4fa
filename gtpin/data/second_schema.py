"""The content of a dataset.toml of schema 2: as in schema 1, with several instruments."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from gtpin.data.description import SCHEMA, Description, explained
from gtpin.data.instrument_tables import (
    HINTS,
    TABLES,
    InstrumentTable,
    SocketTable,
    TiltTable,
    TrackerTable,
    declared_keys,
)
from gtpin.errors import DatasetError

RESERVED = ("carts", "commands", "truth")
"""Names of tables of a dataset's folder that are no instrument's."""


class _Frame(Description):
    """A dataset.toml of schema 2, before its instruments are checked."""

    schema_: Literal["gtpin-dataset/2"] = Field(alias="schema")  # type: ignore[assignment]
    instrument: list[dict[str, Any]]  # type: ignore[assignment]


@dataclass(frozen=True)
class SecondDescription:
    """The whole of a dataset.toml of schema 2: what it shares with schema 1, and its instruments."""

    common: Description
    instruments: tuple[InstrumentTable, ...]


def describe_second(
    values: Mapping[str, Any], file: Path | None, own: Mapping[str, type[InstrumentTable]]
) -> SecondDescription:
    """Check the content of a dataset.toml of schema 2.

    ``own``: classes of the tables of the user's own instruments, by kind.

    Raises `DatasetError` if a key is invalid; it names the key.
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
    common = Description.model_validate({"schema": SCHEMA, **shared})
    return SecondDescription(common, tables)


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
            close = difflib.get_close_matches(key, declared_keys(kind), n=1)
            hint = f"did you mean {close[0]}?" if close else f"known here: {', '.join(declared_keys(kind))}"
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
