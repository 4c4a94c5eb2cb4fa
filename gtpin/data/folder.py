"""The files of a dataset's folder: all of them written at once, and the tables of several instruments (schema 2) read and put
one after the other."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gtpin.data.checks import CheckedRows
from gtpin.data.description import Description, InstrumentSection, read_toml, write_description
from gtpin.data.files import find_table, read_table, write_table
from gtpin.data.ids import Ids
from gtpin.data.instrument_rows import InstrumentRows
from gtpin.data.instrument_tables import NAME, RESERVED, InstrumentTable, TrackerTable, describe_second
from gtpin.data.names import ORIENTATION, POSITION, SIGMAS, TAKEN_IN_POSES, command_names
from gtpin.data.table import Column, DataTable
from gtpin.errors import DatasetError, warn
from gtpin.output.ownership import refuse_foreign, was_moved_aside
from gtpin.output.results import results_folder, writing
from gtpin.typing import Floats

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


@dataclass(frozen=True, eq=False)
class _Part:
    """The rows of one instrument: its section of dataset.toml, (N,) ids, (N, n) commands, m or rad, and by name (N,) columns:
    those of its kind of instrument, and all others."""

    table: InstrumentTable
    rows: CheckedRows
    pose: Ids
    q: Floats
    readings: dict[str, Column]
    covariates: dict[str, Column]

    @property
    def file(self) -> Path:
        assert self.rows.file is not None
        return self.rows.file


def read_instruments(path: Path, kinds: Mapping[str, type[Any]]) -> tuple[Description, dict[str, Any]]:
    """Read a dataset folder of schema 2: its description, and by name what a ``Dataset`` takes of the N rows of all tables.

    ``kinds``: the user's own classes of instruments, by kind; each has its ``Table``.

    Raises `DatasetError` for anything that the format does not allow, with file, line and column. Warns: names covariates
    that only some instruments have, and that are left out.
    """
    toml = path / "dataset.toml"
    common, tables = describe_second(read_toml(toml), toml, {kind: one.Table for kind, one in kinds.items()})
    files = [_file_of(path, i, table) for i, table in enumerate(tables)]
    parts = [_part(files[i], table, _columns_beside(toml, i, tables, files)) for i, table in enumerate(tables)]
    n = parts[0].q.shape[1]
    for part in parts[1:]:
        own = part.q.shape[1]
        if own != n:
            what, hint = f"{own} commands, but {n} in {files[0].name}", "give all tables q1 .. qn"
            raise DatasetError(what, file=part.file, row=1, column=f"q{own}", hint=hint)
    _check_commands(parts)
    _warn_of_files(path, {file.name for file in files})
    counts = [len(part.pose) for part in parts]
    kinds_of_cells = {name: column.dtype for part in parts for name, column in part.readings.items()}
    rows = InstrumentRows(
        tables=tables,
        files=tuple(files),
        of=np.repeat(np.arange(len(parts)), counts),
        line=np.concatenate([part.rows.line for part in parts]),
        columns={name: _joined(parts, name, kind) for name, kind in kinds_of_cells.items()},
        component=np.full(sum(counts), -1),
        known=tuple(
            {n: tuple(dict.fromkeys(map(str, part.readings[n]))) for n in part.table.ids if n in part.readings}
            for part in parts
        ),
        lacking=tuple(frozenset(kinds_of_cells).difference(part.readings) for part in parts),
        kinds=dict(kinds),
    )
    found = {"pose": np.concatenate([part.pose for part in parts]), "q": np.concatenate([part.q for part in parts])}
    covariates, measured = _covariates(toml, parts), _poses(rows)
    if measured is None:
        stands = [table.name for table in tables if isinstance(table, TrackerTable) and table.station is not None]
        if stands:
            only = "only data of one tracker, at the TCP or a free target, use a station"
            warn(f"{toml}: {only}: that of {', '.join(stands)} is not used")
        measured = {"position": np.zeros((len(rows), 3)), "file": path, "readings": rows}
    return common, {**found, "covariates": covariates, **measured}


def _joined(parts: list[_Part], name: str, dtype: np.dtype[Any]) -> Column:
    """(N,) a column of readings in all rows; NaN, or "" for ids, in those of instruments that do not have it."""
    empty = "" if dtype.kind == "O" else np.nan
    columns = (part.readings.get(name, np.full(len(part.pose), empty, dtype=dtype)) for part in parts)
    return np.concatenate([*columns])


def _poses(rows: InstrumentRows) -> dict[str, Any] | None:
    """What a ``Dataset`` takes of poses that could be written in schema 1 too: one tracker's, at the TCP or a free target."""
    table, several = rows.tables[0], len(rows.tables) > 1 or len(rows.known[0].get("target", ())) > 1
    if several or "sx" in rows.columns or not isinstance(table, TrackerTable):
        return None
    if isinstance(table.target, tuple) or table.targets or table.target_sigma or table.stations:
        return None
    same = table.model_dump(include={"orientation_sigma", "frame", "station"})
    sigma, target = table.position_sigma or table.sigma, table.target or "tcp"
    instrument = InstrumentSection(position_sigma=sigma, target=target, **same)
    turned = "qw" in rows.columns
    return {
        "position": np.column_stack([rows.columns[name] for name in POSITION]),
        "orientation": np.column_stack([rows.columns[name] for name in ORIENTATION]) if turned else None,
        "instrument": instrument,
        "row": rows.line,
        "file": rows.files[0],
    }


def _part(file: Path, table: InstrumentTable, beside: set[str]) -> _Part:
    """The rows of a table, without the columns ``beside`` that other instruments read in the same file."""
    read = read_table(file, ids=table.ids)
    rows = CheckedRows.of(file, read.row, len(read))
    q, pose = rows.commands(read.commands()), rows.ids(read.column("pose"), "pose")
    readings = _readings(read, table, rows)
    taken = {"pose", *command_names(q.shape[1]), *readings, *table.optional, *table.ids, *table.numbers, *beside}
    covariates = rows.covariates(read.covariates(taken), q.shape[1], TAKEN_IN_POSES)
    read.warn_of_covariates(taken)
    if isinstance(table, TrackerTable) and table.stations and "session" in covariates:
        readings["session"] = covariates["session"]  # also where other tables lack it
    return _Part(table, rows, pose, q, readings, covariates)


def _readings(read: DataTable, table: InstrumentTable, rows: CheckedRows) -> dict[str, Column]:
    """The columns of readings, by name, that a table of the instrument's kind has."""
    found: dict[str, Column] = {}
    for name in (*table.numbers, *(name for name in table.optional if name in read.columns)):
        found[name] = rows.floats(read.column(name), [name])
    for name in table.ids:
        if name in read.columns or name in table.needed:
            found[name] = rows.ids(read.column(name), name)
    quaternions = read.orientation() if isinstance(table, TrackerTable) else None
    if quaternions is not None:
        found |= dict(zip(ORIENTATION, rows.quaternions(quaternions).T, strict=True))
    if isinstance(table, TrackerTable) and any(name in found for name in SIGMAS):
        for name in SIGMAS if quaternions is not None else SIGMAS[:3]:
            bad = np.flatnonzero(~(read.column(name).astype(float) > 0.0))
            if len(bad):
                what = f"{read.columns[name][bad[0]]:.6g} can't be"
                raise rows.error(int(bad[0]), name, what, "a sigma is above 0, m or rad")
    return found


def _check_commands(parts: list[_Part]) -> None:
    """Raise where rows that share a pose id, in one table or in two, differ in their commands."""
    known: dict[str, tuple[Floats, Path]] = {}
    for part in parts:
        part.rows.same_commands(part.pose, part.q)
        ids, first = np.unique(part.pose.astype(str), return_index=True)
        for pose, index in zip(ids, first, strict=True):
            q, file = known.setdefault(pose, (part.q[index], part.file))
            if np.abs(q - part.q[index]).max() > 1e-12:
                what = f"pose {pose} has other commands here than in {file.name}"
                hint = "rows that share a pose id are one stop of the machine; give each stop an id of its own"
                raise part.rows.error(index, "pose", what, hint)


def _covariates(toml: Path, parts: list[_Part]) -> dict[str, Column]:
    """Covariates of all rows, by name.

    A table without the column takes the values of other tables at the same poses. Where those do not have all its poses, the
    covariate is left out, with a warning.
    """
    found: dict[str, Column] = {}
    lost: list[str] = []
    for name in dict.fromkeys(name for part in parts for name in part.covariates):
        of_pose: dict[str, object] = {}
        for part in parts:
            for pose, value in zip(part.pose, part.covariates.get(name, ()), strict=False):
                of_pose.setdefault(pose, value)
        lacking = [p for p in parts if name not in p.covariates and not of_pose.keys() >= set(p.pose)]
        if lacking:
            lost.append(f"{name} (not in {lacking[0].file.name})")
            continue
        columns = (p.covariates.get(name, [of_pose.get(pose) for pose in p.pose]) for p in parts)
        values = [value for column in columns for value in column]
        found[name] = np.array(values, dtype=object if name == "session" else float)
        found[name].setflags(write=False)
    if lost:
        warn(f"{toml.parent}: covariates that only some tables have are left out: {', '.join(lost)}")
    return found


def _file_of(path: Path, index: int, table: InstrumentTable) -> Path:
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


def _columns_beside(toml: Path, index: int, tables: tuple[InstrumentTable, ...], files: list[Path]) -> set[str]:
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


def _warn_of_files(path: Path, used: set[str]) -> None:
    """Warn of tables in a folder that no instrument uses; ``used``: names of those that are used."""
    try:
        there = sorted(file.name for file in path.iterdir() if file.suffix.lower() in (".csv", ".parquet"))
    except OSError:
        return
    left = [name for name in there if name not in used and Path(name).stem not in RESERVED]
    if left:
        warn(f"{path}: {', '.join(left)}: tables without an [[instrument]] in dataset.toml, ignored")
