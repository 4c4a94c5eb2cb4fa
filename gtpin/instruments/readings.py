"""The readings of all instruments of a dataset as one measurement: residuals and their derivatives, row by row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.data.dataset import Dataset
from gtpin.data.instrument_rows import InstrumentRows
from gtpin.data.instrument_tables import TrackerTable
from gtpin.errors import DatasetError
from gtpin.instruments import BUILT_IN
from gtpin.instruments.instrument import Component, Instrument, Read, RowError, Unknown
from gtpin.instruments.socket import Socket
from gtpin.instruments.tracker import Tracker
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import frame_motions, to_quaternions
from gtpin.model.model import FittedInstrument, Model, in_frame
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Indices, Mask

VAGUE = 1.0
"""Sigma, m and rad, that is used for an unknown without a prior: so wide that the prior has no influence. Assumed."""


@dataclass(frozen=True, eq=False)
class Readings:
    """The readings of all instruments: N rows with c numbers each.

    - ``q``: (N, n) commands, m or rad.
    - ``rows``: the rows. Where the instruments' readings have different numbers of components, each row is one component,
      and c = 1.
    - ``robot``: the nominal robot.
    - ``u``: (k,) deviations of all instruments' unknowns from their declared values, m or rad. Residuals and derivatives
      are at these values.
    """

    q: Floats
    rows: InstrumentRows
    robot: Chain
    u: Floats

    @staticmethod
    def of(dataset: Dataset, robot: Chain, u: Floats | None = None) -> Readings:
        """The readings of a dataset that :func:`single` has returned; poses are those of one tracker without a name.

        ``u``: (k,) deviations of the unknowns; None: zeros.

        Raises `DatasetError` for impossible readings.
        """
        found = Readings.of_rows(dataset.q, dataset.readings, robot)
        return found if u is None else replace(found, u=u)

    @staticmethod
    def of_rows(q: Floats, rows: InstrumentRows, robot: Chain) -> Readings:
        """The readings of some rows at commands q (N, n), with the unknowns as they are declared."""
        found = Readings(q, rows, robot, np.zeros(0))
        return replace(found, u=np.zeros(len(found.unknowns)))

    @staticmethod
    def of_poses(q: Floats, T: Floats, R: Floats | None, robot: Chain) -> Readings:
        """Poses of a single tracker: commands q (N, n), m or rad; T (N, 3), m, and R (N, 3, 3) or None, in its frame."""
        rows = InstrumentRows.of_poses(T, None if R is None else to_quaternions(R), np.arange(len(q)))
        return Readings(q, rows, robot, np.zeros(0))

    def take(self, rows: npt.NDArray[np.generic] | slice) -> Readings:
        """The rows that a mask, indices or a slice select."""
        return replace(self, q=self.q[rows], rows=self.rows.take(rows))  # type: ignore[arg-type]

    def at(self, u: Floats) -> Readings:
        """The same readings with other values (k,) of the unknowns' deviations."""
        if not len(u):
            return self
        found = replace(self, u=u)
        vars(found).update({name: value for name, value in vars(self).items() if name != "u"})  # what is cached
        return found

    @property
    def tracked(self) -> bool:
        """Whether these are the poses of a single tracker, which has no name: their frame is that of the model."""
        return not self.rows.tables[0].name

    @property
    def poses(self) -> tuple[Floats, Floats | None]:
        """(N, 3) positions, m, and (N, 3, 3) orientations or None, that a single tracker has read, in its frame."""
        one = self.instruments[0]
        assert isinstance(one, Tracker)
        return one.positions, one.rotations

    @property
    def station(self) -> Floats | None:
        """(3,) where a single tracker stands in its frame, m; None for others, and where it is not known."""
        table = self.rows.tables[0]
        if not self.tracked or not isinstance(table, TrackerTable) or table.station is None:
            return None
        return np.array(table.station)

    @cached_property
    def instruments(self) -> tuple[Instrument, ...]:
        """The instruments in the order of dataset.toml, each with its own rows."""
        return instruments_of(self.rows, self.robot)

    @cached_property
    def components(self) -> int:
        """The number c of components of a row."""
        if (self.rows.component >= 0).any():
            return 1
        return max(len(one.components) for one in self.instruments)

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Unknowns of all instruments, in the order of ``u``."""
        return tuple(unknown for one in self.instruments for unknown in one.unknowns)

    @cached_property
    def sigma(self) -> Floats:
        """(k,) prior sigma of each unknown; infinite where it has none."""
        return np.array([unknown.sigma for unknown in self.unknowns])

    @cached_property
    def group(self) -> npt.NDArray[np.intp]:
        """(N, c) index of each number's noise sigma, counted over all instruments."""
        first = np.cumsum([0, *(len(one.declared) for one in self.instruments)])

        def own(i: int, one: Instrument) -> Indices:
            groups = first[i] + np.array([c.group for c in one.components])
            return np.broadcast_to(groups, (one.read.count, len(one.components)))

        return self._each(own)

    @property
    def noise_groups(self) -> list[Indices]:
        """Groups of rows whose residuals are compared with each other to find outliers: indices of the rows of each group.

        A group has the rows of one instrument; where c = 1, those of one noise sigma. Groups are separate because, before a
        fit, residuals over their sigmas can be much larger for positions than for orientations.
        """
        first = self.group[:, 0]
        return [np.flatnonzero(first == group) for group in np.unique(first)]

    @property
    def read(self) -> Indices:
        """(N,) what each row reads at its commands: rows with the same number and the same commands repeat one reading."""
        return self.rows.read

    @cached_property
    def _groups(self) -> tuple[tuple[str, Component, float | None], ...]:
        """For each of the G groups: name of the instrument, the first of its components, and its declared sigma."""
        return tuple(
            (one.name, next(c for c in one.components if c.group == group), sigma)
            for one in self.instruments
            for group, sigma in enumerate(one.declared)
        )

    @cached_property
    def declared(self) -> tuple[float | None, ...]:
        """Declared sigma of each of the G groups, m or rad; None where it is to be estimated."""
        return tuple(sigma for *_, sigma in self._groups)

    @cached_property
    def number_names(self) -> npt.NDArray[np.str_]:
        """(N, c) name of each number: its component, ``x``, after the name of an instrument that has one: ``wire.range``."""

        def own(_: int, one: Instrument) -> npt.NDArray[np.str_]:
            names = [f"{one.name}.{c.name}" if one.name else c.name for c in one.components]
            return np.broadcast_to(np.array(names, dtype=object), (one.read.count, len(names)))

        return self._each(own)

    @property
    def group_names(self) -> tuple[str, ...]:
        """(G,) the instrument's name for each group."""
        return tuple(name for name, *_ in self._groups)

    @cached_property
    def group_turns(self) -> npt.NDArray[np.bool_]:
        """(G,) whether the numbers of each group are angles, rad."""
        return np.array([component.unit == "rad" for _, component, _ in self._groups])

    @cached_property
    def initial_sigma(self) -> Floats:
        """(G,) declared sigmas, m or rad; where none is declared, the one at which its estimation starts."""
        return np.array([sigma or component.initial_sigma for _, component, sigma in self._groups])

    @cached_property
    def shown(self) -> Mask:
        """(N, c) whether the error of each number is reported."""

        def own(_: int, one: Instrument) -> Mask:
            return np.broadcast_to([c.shown for c in one.components], (one.read.count, len(one.components)))

        return self._each(own)

    @cached_property
    def row_sigma(self) -> Floats:
        """(N, c) sigmas that the tables declare row by row, m or rad; NaN where there is none."""

        def own(_: int, one: Instrument) -> Floats:
            sigmas = one.row_sigmas()
            return np.broadcast_to(np.nan, (one.read.count, len(one.components))) if sigmas is None else sigmas

        return self._each(own)

    @cached_property
    def counted(self) -> Floats:
        """(N, c) degrees of freedom that each number counts as: see :meth:`Instrument.counted`."""
        return self._each(lambda _, one: one.counted())

    def residual_at(self, poses: Poses) -> Floats:
        """(N, c) measured less predicted at poses (N) of the TCP, base frame."""
        return self._each(lambda i, one: one.residual_at(self._part(poses, i), self.u[self._own[i]]))

    def by_motion(self, poses: Poses) -> Floats:
        """(N, c, 6 + 3 l + j) derivative of the readings by a shift, m, and a rotation vector, rad, of the platform, base
        frame, by rotation vectors of the robot's l measured links, and by the coordinates, rad or m, of its j measured joints.
        """

        def own(i: int, one: Instrument) -> Floats:
            there, u = self._part(poses, i), self.u[self._own[i]]
            parts = [one.by_pose(there, u)]
            parts += [one.by_links(there, u)] if there.links else []
            parts += [one.by_joints(there, u)] if there.joints else []
            return np.concatenate(parts, axis=2) if len(parts) > 1 else parts[0]

        return self._each(own)

    def by_unknown(self, poses: Poses) -> Floats:
        """(N, c, k) derivative of the readings by the unknowns ``u``."""

        def own(i: int, one: Instrument) -> Floats:
            mine = one.by_unknown(self._part(poses, i), self.u[self._own[i]])
            whole = np.zeros((*mine.shape[:2], len(self.u)))
            whole[:, :, self._own[i]] = mine
            return whole

        return self._each(own)

    def residual(self, model: Model, poses: Poses) -> Floats:
        """(N, c) measured less predicted at poses (N), base frame, as instruments in the model's frame read them."""
        return self.residual_at(model.in_instrument_frame(poses))

    def change_by(self, J: Floats, model: Model, poses: Poses) -> Floats:
        """(N, c, m) change of the readings by m motions J (N, 6 + j, m) of the poses, base frame, and of j measured joints."""
        if self.tracked:  # the components are those of the pose
            return in_frame(J, model.frame)[:, : self.components]
        return np.asarray(self.by_motion(model.in_instrument_frame(poses)) @ in_frame(J, model.frame))

    def unknown_columns(self, model: Model, poses: Poses, free_frame: bool, pivot: Floats | None) -> tuple[Floats, int]:
        """(N, c, k) derivatives by the unknowns in units of their prior sigmas, and by a free frame; and how many of these have
        no prior.

        An unknown without a prior gets one of the sigma ``VAGUE``. The last six are those of a free frame, without a prior:
        shifts, m, and rotations, rad, about ``pivot`` (3,), or about the middle of the poses if that is None.
        """
        seen = model.in_instrument_frame(poses)
        known = self.by_unknown(seen) * np.where(np.isfinite(self.sigma), self.sigma, VAGUE)
        if not free_frame:
            return known, 0
        motion = frame_motions(seen.T - (seen.T.mean(axis=0) if pivot is None else pivot))
        return np.concatenate([known, self.by_motion(seen) @ motion], axis=2), 6

    def at_trials(self, rows: npt.NDArray[np.intp], q: Floats) -> Readings:
        """Readings at other commands q (M, n), read in the same way as the present rows with the indices ``rows`` (M,).

        Their measured numbers have no meaning: only derivatives are used.
        """
        return replace(self.take(rows), q=q)

    def own(self, index: int) -> Floats:
        """Deviations of the unknowns of the instrument with the index ``index``, m or rad."""
        return self.u[self._own[index]]

    @property
    def deviation(self) -> Floats:
        """(k,) deviations of the unknowns in units of their prior sigmas; 0 for an unknown without a prior."""
        return np.asarray(np.where(np.isfinite(self.sigma), self.u / self.sigma, 0.0))

    def free_unknowns(self, free_frame: bool) -> int:
        """Number of unknowns without a prior, which is the number of degrees of freedom that they take."""
        return int((~np.isfinite(self.sigma)).sum()) + (6 if free_frame else 0)

    def start(self, nominal: Poses) -> Floats:
        """(k,) first guess of the unknowns' deviations from the poses (N) of the nominal robot, base frame."""
        parts = [one.start(nominal[self._rows[i]]) for i, one in enumerate(self.instruments)]
        return np.concatenate([np.zeros(0), *parts])

    def rms(self, index: int, values: Floats, unit: str | None = None) -> float:
        """Root mean square error of one instrument's readings, m or rad; for positions, of the length of the error vector.

        ``index``: of the instrument. ``values``: (N, c) errors of all rows of all instruments. ``unit``: that of the numbers
        which count; None: that of the first one.
        """
        own, mine = self.instruments[index].components, self.rows.of == index
        unit = own[0].unit if unit is None else unit
        counts = np.array([c.shown and c.unit == unit for c in own])
        if values.shape[1] < len(own):  # each row has one number
            some = values[mine & counts[np.maximum(self.rows.component, 0) % len(own)]]
        else:
            some = values[mine][:, counts]
        return float(np.sqrt(counts.sum() * (some**2).mean())) if some.size else 0.0

    @property
    def fitted(self) -> tuple[FittedInstrument, ...]:
        """The instruments with the values of their unknowns; a single tracker, which has no name, is none."""
        found = []
        for i, one in enumerate(self.instruments):
            if not one.name:
                continue
            numbers = one.read.numbers
            columns = tuple(n for n in one.table.optional if n in numbers and np.isfinite(numbers[n]).all())
            values = {unknown.name: float(v) for unknown, v in zip(one.unknowns, self.u[self._own[i]], strict=True)}
            found.append(FittedInstrument(one.table, columns, self.rows.known[i], values))
        return tuple(found)

    @cached_property
    def _rows(self) -> tuple[Indices, ...]:
        return tuple(self.rows.rows_of(i) for i in range(len(self.rows.tables)))

    @cached_property
    def _own(self) -> tuple[slice, ...]:
        """Slice of each instrument's unknowns in ``u``."""
        ends = np.cumsum([0, *(len(one.unknowns) for one in self.instruments)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    def _part(self, poses: Poses, index: int) -> Poses:
        """The poses of an instrument's rows."""
        return poses if len(self.rows.tables) == 1 else poses[self._rows[index]]

    def _each(self, values: Callable[[int, Instrument], npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """(N, c, ...) values of all rows, from a function that gives those of one instrument.

        Where each row is one component (c = 1), only the values of that component are kept.
        """
        found: npt.NDArray[Any] | None = None
        for i, one in enumerate(self.instruments):
            mine = values(i, one)
            if self.components == 1 and mine.shape[1] > 1:
                mine = mine[np.arange(len(mine)), np.maximum(one.read.component, 0)][:, None]
            if len(self.instruments) == 1:
                return mine
            if found is None:
                found = np.empty((len(self.rows), *mine.shape[1:]), dtype=mine.dtype)
            found[self._rows[i]] = mine
        assert found is not None
        return found


def instruments_of(rows: InstrumentRows, robot: Chain) -> tuple[Instrument, ...]:
    """The instruments of some rows, in the order of dataset.toml.

    Raises `DatasetError` for impossible readings, with file and line.
    """
    found = []
    for i, table in enumerate(rows.tables):
        kind: type[Instrument] | None = rows.kinds.get(table.kind) or BUILT_IN.get(table.kind)
        if kind is None:
            hint = f"{', '.join(BUILT_IN)} are; measure with one of them"
            raise DatasetError(f"instruments of kind {table.kind} are not supported yet", column=table.name, hint=hint)
        try:
            found.append(kind(table, Read.of(rows, i), robot))
            found[-1].check()
        except RowError as error:
            file, line = rows.place(int(rows.rows_of(i)[error.index]))
            raise DatasetError(error.what, file=file, row=line, column=error.column, hint=error.hint) from None
        except DatasetError as error:
            if error.file is not None:
                raise
            raise DatasetError(
                error.what, file=rows.files[i], row=error.row, column=error.column, hint=error.hint
            ) from None
    return tuple(found)


def single(dataset: Dataset, robot: Chain) -> Dataset:
    """The dataset with the same number of components in each row.

    Where instruments' readings differ in their number of components, each row is split into one row for each component. These
    keep the line number of the original row in ``row``. Known distances are assigned to rows here, for every part of them.
    """
    rows = dataset.readings
    if (rows.component >= 0).any():
        return dataset
    instruments = instruments_of(rows, robot)
    links = np.full(len(rows), np.nan)
    for i, one in enumerate(instruments):
        if isinstance(one, Socket):
            links[rows.rows_of(i)] = one.link
    counts = [one.read_components() for one in instruments]
    if np.isfinite(links).any():
        rows = replace(rows, columns={**rows.columns, "link": links})
        dataset = replace(dataset, readings=rows)
    widths = {own.shape[1] for own in counts}
    if len(widths) == 1 and all(own.all() for own in counts):
        return dataset
    take, component = [], []
    for i, own in enumerate(counts):
        row, which = np.nonzero(own)
        take.append(rows.rows_of(i)[row])
        component.append(which)
    order = np.concatenate(take)
    split = dataset.take(order)
    return replace(split, readings=replace(split.readings, component=np.concatenate(component).astype(np.int64)))
