"""What the instruments of a dataset read: their tables' rows, one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtpin.data.description import LARGEST, InstrumentSection
from gtpin.data.ids import joint_codes
from gtpin.data.instrument_tables import InstrumentTable, SocketTable, TrackerTable
from gtpin.data.names import ORIENTATION, POSITION
from gtpin.data.table import Column
from gtpin.errors import DatasetError
from gtpin.typing import Floats

Rows = NDArray[np.bool_] | NDArray[np.integer[Any]] | slice | list[int]


@dataclass(frozen=True, eq=False)
class InstrumentRows:
    """N rows of several instruments.

    - ``tables``: section of dataset.toml of each instrument.
    - ``files``: file of each instrument's rows; None where they were not read from a file.
    - ``of``: (N,) index of each row's instrument.
    - ``line``: (N,) line of each row in its instrument's file.
    - ``columns``: (N,) each, by name: readings, and ids of stations, planes, sockets and targets. NaN, or "" for an id, in
      rows of instruments without the column.
    - ``component``: (N,) index of the one component of the reading that a row has, from 0; -1 where the row has all
      components.
    - ``known``: for each instrument, by column of ids: the ids in all rows that were read.
    - ``lacking``: for each instrument, the columns that its table does not have.
    - ``kinds``: the user's own classes of instruments, by their kind.
    """

    tables: tuple[InstrumentTable, ...]
    files: tuple[Path | None, ...]
    of: NDArray[np.int64]
    line: NDArray[np.int64]
    columns: Mapping[str, Column]
    component: NDArray[np.int64]
    known: tuple[Mapping[str, tuple[str, ...]], ...]
    lacking: tuple[frozenset[str], ...] = (frozenset(),)
    kinds: Mapping[str, type[Any]] = field(default_factory=dict)

    @staticmethod
    def of_poses(
        T: Floats,
        quaternions: Floats | None,
        line: NDArray[np.int64],
        instrument: InstrumentSection | None = None,
        file: Path | None = None,
    ) -> InstrumentRows:
        """Poses that a single tracker has read: T (N, 3), m, and quaternions (N, 4) or None; ``line``: (N,).

        It has no name, except where it has several stations, or a target off the TCP: it is then ``tracker``.
        """
        columns = dict(zip(POSITION, T.T, strict=True))
        if quaternions is not None:
            columns |= dict(zip(ORIENTATION, quaternions.T, strict=True))
        declared = {} if instrument is None else instrument.model_dump(exclude={"frame", "target"})
        table, of = TrackerTable.model_construct(name="", kind="tracker", **declared), np.zeros(len(T), dtype=np.int64)
        if instrument is not None and instrument.reads:
            table = TrackerTable(name="tracker", kind="tracker", **instrument.model_dump())
        return InstrumentRows((table,), (file,), of, line, columns, np.full(len(T), -1), ({},))

    @property
    def tracked(self) -> bool:
        """Whether these are the poses of a single tracker, which has no name: their frame is that of the model."""
        return not self.tables[0].name

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the instruments, in their order; none for a single tracker."""
        return tuple(table.name for table in self.tables if table.name)

    @property
    def stations(self) -> tuple[bool, ...]:
        """For each instrument, whether it has a free frame for each session."""
        return tuple(isinstance(table, TrackerTable) and table.stations is not None for table in self.tables)

    def __len__(self) -> int:
        return len(self.of)

    def take(self, rows: Rows) -> InstrumentRows:
        """Some of the rows, in the given order."""
        return replace(
            self,
            of=self.of[rows],
            line=self.line[rows],
            columns={name: values[rows] for name, values in self.columns.items()},
            component=self.component[rows],
        )

    def at_stations(self, session: Column | None) -> InstrumentRows:
        """The rows with the ids of the stations of trackers that have several: their ``session`` (N,); None: as before.

        Raises `DatasetError` where there are none.
        """
        own = self.stations
        if not any(own):
            return self
        if session is None and "session" not in self.columns:
            what, hint = 'stations = "session" without sessions', "give each row the session it is of"
            raise DatasetError(what, file=self.files[own.index(True)], row=1, column="session", hint=hint)
        column = self.columns["session"] if session is None else np.where(np.array(own)[self.of], session, "")
        names = (tuple(sorted(set(column[self.of == i]))) for i in range(len(own)))
        return replace(
            self,
            columns={**self.columns, "session": column},
            known=tuple(k | {"session": n} if o else k for k, n, o in zip(self.known, names, own, strict=True)),  # type: ignore[operator]
            lacking=tuple(k - {"session"} if o else k | {"session"} for k, o in zip(self.lacking, own, strict=True)),
        )

    def without_unvisited(self) -> InstrumentRows:
        """The same rows without sockets that none of them visits: their ids, and the known distances that they have.

        Points that dataset.toml declares with ``socket_sigma`` stay. Of more known distances than rows, the first stay: each
        is assigned to a row. Rows of single components, and those with a column ``link``, refer to distances by their number:
        nothing is left out of them.
        """
        if "link" in self.columns or (self.component >= 0).any():
            return self
        tables, known = list(self.tables), list(self.known)
        for i, table in enumerate(self.tables):
            if not isinstance(table, SocketTable) or "socket" not in self.columns:
                continue
            rows = self.rows_of(i)
            visited = set(self.columns["socket"][rows].astype(str))
            there = visited.union(table.sockets if table.socket_sigma else ())
            kept = tuple(one for one in table.distances if there.issuperset(one[:2]))[: len(rows)]
            tables[i] = table.model_copy(update={"distances": kept})
            known[i] = {**known[i], "socket": tuple(name for name in known[i].get("socket", ()) if name in visited)}
        return replace(self, tables=tuple(tables), known=tuple(known))

    @property
    def read(self) -> NDArray[np.intp]:
        """(N,) index of what each row reads: rows of one instrument, component, station, plane, socket and target share it."""
        ids = [c.astype(str) for c in self.columns.values() if c.dtype == object]
        if not ids and len(self.tables) == 1 and (self.component < 0).all():
            return np.zeros(len(self), dtype=np.intp)
        return joint_codes([self.of, self.component, *ids])

    def what(self, row: int) -> str:
        """What a row reads, as words: its instrument, and its station, plane, socket and target."""
        ids = [str(c[row]) for c in self.columns.values() if c.dtype == object and c[row] != ""]
        return " ".join([self.tables[self.of[row]].name, *ids])

    @property
    def row(self) -> NDArray[np.intp]:
        """(N,) number of the table's row that each row is of, from 0: the components of one reading share it."""
        return joint_codes([self.of, self.line])

    @property
    def countable(self) -> NDArray[np.bool_]:
        """(N,) rows whose numbers are all small enough for computations."""
        good = np.ones(len(self), dtype=bool)
        for column in self.columns.values():
            if column.dtype != object:
                good &= ~(np.abs(column) > LARGEST)
        return good

    def rows_of(self, index: int) -> NDArray[np.intp]:
        """Rows of an instrument, by its index."""
        return np.flatnonzero(self.of == index)

    def columns_of(self, index: int) -> dict[str, Column]:
        """The columns that an instrument reads, by name: those of its kind that are not empty in its rows."""
        rows, table = self.rows_of(index), self.tables[index]
        names = [n for n in (*table.numbers, *table.optional, *table.ids, *self.known[index]) if n in self.columns]
        found = {name: self.columns[name][rows] for name in names}
        return {n: c for n, c in found.items() if not ((c == "") if c.dtype == object else np.isnan(c)).all()}

    def place(self, row: int) -> tuple[Path | None, int]:
        """File and line of a row."""
        return self.files[self.of[row]], int(self.line[row])


POSES = InstrumentRows.of_poses(np.empty((0, 3)), None, np.empty(0, dtype=np.int64))
"""Poses of a single tracker, before a dataset gives them."""
