"""A dataset: measured poses of a robot, and under what conditions they were measured."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from gtpin.data.checks import CheckedRows, unnumbered
from gtpin.data.commands import CartMeasurements, Commands
from gtpin.data.description import (
    SCHEMA,
    SECOND,
    Conditions,
    Description,
    Driver,
    InstrumentSection,
    describe,
    read_toml,
)
from gtpin.data.files import check_folder, find_table, read_table
from gtpin.data.folder import SUFFIXES, read_instruments, tables_there, write_folder
from gtpin.data.ids import Ids, codes
from gtpin.data.instrument_rows import POSES, InstrumentRows
from gtpin.data.instrument_tables import written
from gtpin.data.names import ORIENTATION, POSITION, TAKEN_IN_POSES, ZERO_COUNTS, command_names
from gtpin.data.table import Column
from gtpin.errors import DatasetError, noted, warn
from gtpin.output.shown import Shown, present
from gtpin.references import is_path
from gtpin.typing import Floats

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


DESCRIBED = ("tcp", "actuators", "home", "conditions", "tolerance")
"""Keys of dataset.toml that a dataset has as they are."""


@dataclass(frozen=True, eq=False, repr=False)
class Dataset(Shown):
    """N measured TCP poses of a robot with n actuators.

    Parameters
    ----------
    robot
        The robot's name or a path to its URDF or MJCF file, as dataset.toml has it.
    pose
        (N,) ids, `str`. Rows with the same id are visits to the same commands.
    q
        (N, n) commands, m or rad.
    position
        (N, 3) measured TCP in the instrument's frame, m.
    orientation
        (N, 4) unit quaternions, wxyz; None where only positions were measured.
    covariates
        By name, (N,) each: `session` as ids, everything else as float64 in SI units (temperatures in degC).
    instrument, conditions, tolerance
        The sections with these names in dataset.toml, also as dicts: sigmas and frame of the instrument, the reference
        temperature, and tolerances of the geometry.
    tcp
        The link whose pose is measured; None for the robot's own TCP.
    actuators
        The joints that q1 .. qn command; empty for the robot's own.
    home
        The commands of the home posture, or the name of a keyframe of an MJCF; empty for the robot's own.
    drivers
        Recorded columns, such as a tilt sensor, that the diagnosis tests as causes of deviations.
    carts
        Cart poses, where they were measured.
    path
        The folder that holds the dataset.
    row
        (N,) line number of each row in its file, for messages; by default 2, 3, ... (line 1 is the header).
    file
        The table that the rows were read from; None where they were not read from a file.
    unusable
        Names of recorded covariates that were removed from ``covariates`` because their values are impossible.
    readings
        The rows of the instruments. Those of a single tracker, which has no name, are always ``position`` and ``orientation``;
        with ``stations``, or with a target off the TCP, it is called ``tracker``, and these are its readings.
        For other instruments, ``position`` is not measured: it is zero until a robot is known, then the nominal TCP in the
        base frame.
    warnings
        Texts of the warnings when it was read: results repeat them.
    trusted
        Whether checks for usual mistakes (units, signs, orders of columns) only warn, and never refuse the data.
    rows_of
        Number of rows of the dataset of which these were chosen (``poses`` of :func:`gtpin.calibrate`); None: none were left
        out.

    Raises
    ------
    DatasetError
        Where shapes do not fit, or a value is not valid for its column.

    Examples
    --------
    >>> import gtpin
    >>> dataset = gtpin.Dataset.read("measured")
    >>> dataset
    Dataset of gantry_tau: 66 measured positions and orientations at 60 poses
    covariates: time, temp_frame, temp_link, payload, approach1, approach2, approach3, speed1, speed2, speed3
    >>> dataset.plot_workspace("xz", color="time").layout.xaxis.title.text
    'x (m)'
    """

    robot: str
    pose: Ids
    q: Floats
    position: Floats
    orientation: Floats | None = None
    covariates: Mapping[str, Column] = field(default_factory=dict)
    instrument: InstrumentSection = field(default_factory=InstrumentSection)
    conditions: Conditions = field(default_factory=Conditions)
    tolerance: Mapping[str, float] = field(default_factory=dict)
    tcp: str | None = None
    actuators: tuple[str, ...] = ()
    home: tuple[float, ...] | str = ()
    drivers: tuple[Driver, ...] = ()
    carts: CartMeasurements | None = None
    path: Path | None = None
    row: NDArray[np.int64] = field(default_factory=unnumbered)
    file: Path | None = None
    unusable: frozenset[str] = frozenset()
    readings: InstrumentRows = POSES
    warnings: tuple[str, ...] = ()
    trusted: bool = False
    rows_of: int | None = None

    def __post_init__(self) -> None:
        description = self._description(self.robot)
        rows = CheckedRows.of(self.file, self.row, len(self.pose))
        pose, q = rows.ids(self.pose, "pose"), rows.commands(self.q)
        rows.same_commands(pose, q)
        values = {
            "pose": pose,
            "q": q,
            "position": rows.floats(self.position, list(POSITION)),
            "orientation": None if self.orientation is None else rows.quaternions(self.orientation),
            "covariates": rows.covariates(self.covariates, q.shape[1], TAKEN_IN_POSES),
            **{name: getattr(description, name) for name in ("robot", "instrument", "drivers", *DESCRIBED)},
            "tolerance": dict(description.tolerance),
            "row": rows.line,
        }
        if self.actuators and len(self.actuators) != q.shape[1]:
            what = f"{q.shape[1]} columns of commands for {len(self.actuators)} actuators of dataset.toml"
            raise DatasetError(what, file=self.file, column=f"q{q.shape[1]}", hint="give one for each, q1 .. qn")
        for name, value in values.items():
            object.__setattr__(self, name, value)
        if self.readings.tracked:
            read = InstrumentRows.of_poses(self.position, self.orientation, self.row, self.instrument, self.file)
            object.__setattr__(self, "readings", read)
        if self.instrument.reads:
            object.__setattr__(self, "instrument", InstrumentSection())
            object.__setattr__(self, "position", np.zeros_like(self.position))
            object.__setattr__(self, "orientation", None)
        object.__setattr__(self, "readings", self.readings.at_stations(self.covariates.get("session")))

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def n_actuators(self) -> int:
        """Number of commanded actuators."""
        return int(self.q.shape[1])

    @property
    def rows_used(self) -> dict[str, int]:
        """Number of rows, and of those of the dataset of which they were chosen: as results have it in JSON."""
        return {"used": len(self), "of": self.rows_of or len(self)}

    def place(self, index: int) -> tuple[Path | None, int]:
        """File, and line in it, of the row with this index (counted from 0)."""
        return self.readings.place(index)

    @property
    def toml(self) -> Path | None:
        """Its dataset.toml; None where it was not read from a folder."""
        return self.path and self.path / "dataset.toml"

    def names_of(self, rows: NDArray[np.generic]) -> tuple[str, ...]:
        """The ids of the poses of some rows, each once."""
        return tuple(dict.fromkeys(map(str, self.pose[rows])))

    @property
    def robot_reference(self) -> str | Path:
        """The name of a robot, or the absolute path of its file (relative paths start at `path`)."""
        if is_path(self.robot):
            return Path(os.path.abspath((self.path or Path()) / self.robot))
        return self.robot

    @cached_property
    def visits(self) -> NDArray[np.intp]:
        """(N,) index of each row's pose among the dataset's sorted pose ids: equal for all visits to one pose."""
        return codes(self.pose)[0]

    @property
    def commands(self) -> Commands:
        """The commands and covariates without what was measured."""
        return Commands(self.pose, self.q, self.covariates, self.row, self.file)

    def refuse_readings(self, what: str, hint: str) -> None:
        """Raise `DatasetError` unless these are the poses of one tracker; ``what``: what readings can't be used for."""
        if not self.readings.tracked:
            raise DatasetError(what, file=self.path, hint=hint)

    def all_warnings(self, texts: Iterable[str]) -> tuple[str, ...]:
        """Texts of its own warnings and of others, each once; files are named without the folder that holds the dataset."""
        folder = "" if self.path is None else f"{self.path}{os.sep}"
        return tuple(dict.fromkeys(text.replace(folder, "") if folder else text for text in (*self.warnings, *texts)))

    def without(self, names: Collection[str]) -> Dataset:
        """The dataset without the covariates ``names``, which have impossible values; ``unusable`` then lists them."""
        kept = {name: values for name, values in self.covariates.items() if name not in names}
        return replace(self, covariates=kept, unusable=self.unusable | frozenset(names))

    def take(self, rows: NDArray[np.bool_] | NDArray[np.integer] | slice | list[int]) -> Dataset:
        """The dataset of the rows that a mask or indices select, in the order of the indices; ``carts`` is not changed.

        Sockets that none of these rows visits are left out, with their known distances, as if only these rows had been read.
        """
        if isinstance(rows, np.ndarray) and rows.dtype == bool and rows.shape == (len(self),) and rows.all():
            return self
        return replace(
            self,
            pose=self.pose[rows],
            q=self.q[rows],
            position=self.position[rows],
            orientation=None if self.orientation is None else self.orientation[rows],
            covariates={name: values[rows] for name, values in self.covariates.items()},
            row=self.row[rows],
            readings=self.readings.take(rows).without_unvisited(),
        )

    def in_order(self) -> Dataset:
        """The dataset with rows sorted by pose, and visits to a pose by covariates and measured values.

        The result is the same for any order of the input. Readings with equal covariates keep the order of the input.
        """
        keys = [codes(values)[0] for values in self.covariates.values()]
        measured = self.position if self.orientation is None else np.hstack([self.position, self.orientation])
        # Rows of equal values are equal in all but their lines; readings of one pose have one ``position``.
        return self.take(np.lexsort([self.readings.component, self.row, *keys, *measured.T[::-1], self.visits]))

    @classmethod
    def read(cls, path: Path | str, instruments: Iterable[type[Any]] = ()) -> Dataset:
        """Read a dataset folder.

        ``instruments`` are your own classes of instruments, in addition to those of gtpin: see
        :class:`~gtpin.instruments.Instrument`.

        Raises `DatasetError`, with file, line, column and what to do, for anything that the format does not allow.
        Warns of columns that have text in place of numbers, and of covariates that do not vary.
        """
        with noted() as texts:
            found = cls._read(Path(path), instruments)
        return replace(found, warnings=tuple(texts))

    @classmethod
    def _read(cls, path: Path, instruments: Iterable[type[Any]]) -> Dataset:
        """The dataset of a folder."""
        check_folder(path, "a dataset is the folder that holds dataset.toml")
        values, table = read_toml(path / "dataset.toml"), None
        taken = {"pose", *POSITION, *ORIENTATION}
        rows: dict[str, Any]
        if values.get("schema") == SECOND:
            common, rows = read_instruments(path, {kind.kind: kind for kind in instruments})
        else:
            common = describe(values, path / "dataset.toml")
            file = find_table(path, "poses") or path / "poses.csv"
            table = read_table(file)
            rows = {"pose": table.column("pose"), "q": table.commands(), "position": table.matrix(POSITION)}
            taken |= {*command_names(rows["q"].shape[1])}
            rows |= {"orientation": table.orientation(), "covariates": table.covariates(taken)}
            rows |= {"instrument": common.instrument, "row": table.row, "file": file}
        carts = find_table(path, "carts")
        rows |= {name: getattr(common, name) for name in ("robot", "drivers", *DESCRIBED)}
        dataset = cls(carts=CartMeasurements.read(carts, rows["q"].shape[1]) if carts else None, path=path, **rows)
        if table is not None:
            table.warn_of_covariates(taken)
        dataset._check_drivers()
        constant = {name: column[0] for name, column in dataset.covariates.items() if (column == column[0]).all()}
        still = [name for name, value in constant.items() if not (ZERO_COUNTS.fullmatch(name) and value == 0.0)]
        if still:
            where = dataset.file if table is not None else path
            warn(f"{where}: these covariates do not vary, so they give no information: {', '.join(still)}")
        return dataset

    def write(self, folder: Path | str, table: Literal["csv", "parquet"] = "csv", *, force: bool = False) -> None:
        """Write a dataset folder. `read` gives exactly the same values; after an error no part of the folder is there.

        A dataset that gtpin wrote there is replaced. A relative path to a URDF is rewritten to start at `folder`.
        Raises `DatasetError` where the folder can't be written, or holds a file that gtpin has not written or that was changed
        since. With `force`, such tables and such a dataset.toml are renamed (NAME.old-1), and other files stay.
        """
        folder = Path(folder)
        description, sections = self._description(self._robot_seen_from(folder)), []
        tables: dict[str, dict[str, Column]] = {}
        for index, one in enumerate(self.readings.tables):
            mine = self.readings.rows_of(index)
            if len(mine):  # an instrument without rows is left out
                tables[one.name or "poses"] = {
                    "pose": self.pose[mine],
                    **dict(zip(command_names(self.n_actuators), self.q[mine].T, strict=True)),
                    **self.readings.columns_of(index),
                    **{name: column[mine] for name, column in self.covariates.items()},
                }
                if one.name:  # [instrument] describes a single tracker
                    sections.append(written(one.model_copy(update={"file": None})))
        if self.carts is not None:
            tables["carts"] = self.carts.columns
        empty = [f"{name}.{suffix}" for name in self.readings.names for suffix in SUFFIXES if name not in tables]
        old = (*tables_there(folder), *empty)
        write_folder(folder, description, sections, tables, table, old=old, force=force)

    def save(self, folder: Path | str, *, force: bool = False) -> None:
        """Write a dataset folder with CSV tables; see :meth:`write`."""
        self.write(folder, force=force)

    def plot_workspace(self, view: str = "xy", color: str | None = None) -> Figure:
        """Plot the measured positions, m, in a plane of the instrument's frame: ``xy``, ``xz`` or ``yz``.

        ``color``: name of a command (``q1``) or covariate whose values colour the points; None: one colour.
        """
        figure: Figure = present(self).workspace(view, color)
        return figure

    def _check_drivers(self) -> None:
        file = self.toml
        for number, driver in enumerate(self.drivers):
            if driver.column not in self.covariates or driver.column == "session":
                recorded = ", ".join(name for name in self.covariates if name != "session") or "none"
                what, hint = f"no column of numbers is called {driver.column!r}", f"recorded are: {recorded}"
                raise DatasetError(what, file=file, column=f"driver.{number}.column", hint=hint)
            before = [(one.column, one.site, one.motion) for one in self.drivers[:number]]
            if (driver.column, driver.site, driver.motion) in before:
                raise DatasetError("the driver comes twice", file=file, column=f"driver.{number}", hint="keep one")

    def _description(self, robot: str) -> Description:
        same = {name: getattr(self, name) for name in ("instrument", *DESCRIBED)}
        drivers = [asdict(driver) for driver in self.drivers]
        whole = {"schema": SCHEMA, "robot": robot, "driver": drivers, **same, "tolerance": dict(self.tolerance)}
        return describe(whole)

    def _robot_seen_from(self, folder: Path) -> str:
        reference = self.robot_reference
        if isinstance(reference, str) or self.path is None or os.path.isabs(self.robot):
            return self.robot
        if os.path.abspath(folder) == os.path.abspath(self.path):
            return self.robot
        return Path(os.path.relpath(reference, os.path.abspath(folder))).as_posix()
