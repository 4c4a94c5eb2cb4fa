"""The base class of instruments: what one reads of the robot, and what is unknown of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from gtpin.data.instrument_rows import InstrumentRows
from gtpin.data.instrument_tables import InstrumentTable
from gtpin.data.table import Column
from gtpin.errors import DatasetError
from gtpin.instruments.up import up_of
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]

STEP = 1e-6
"""Step of numerical derivatives, m and rad, of instruments that do not give their own."""


@dataclass(frozen=True)
class Unknown:
    """Something of an instrument that is identified together with the robot.

    Parameters
    ----------
    name
        As in ``wire.station[A].x``.
    unit
        ``m`` or ``rad``.
    nominal
        Value that is declared.
    sigma
        Standard deviation of its prior about ``nominal``; infinite if it has none.

    Examples
    --------
    >>> import gtpin
    >>> gtpin.Unknown("string.length", "m", nominal=0.0, sigma=1e-2).unit
    'm'
    """

    name: str
    unit: str
    nominal: float
    sigma: float


@dataclass(frozen=True)
class Component:
    """One of the numbers of a reading.

    Parameters
    ----------
    name
        As in reports: ``range``, ``x``.
    unit
        ``m`` or ``rad``.
    group
        Index of the sigma that it shares with others: those of a tracker's position have one, those of its orientation another.
    usual
        Sigma at which the estimation starts if none is declared.
    shown
        Whether residuals of it are a part of the instrument's root mean square error.

    Examples
    --------
    >>> import gtpin
    >>> gtpin.Component("height", "m").usual
    2e-05
    """

    name: str
    unit: str
    group: int = 0
    usual: float = 2e-5
    shown: bool = True


@dataclass(frozen=True, eq=False)
class Read:
    """M rows of one instrument, with what the table has of each.

    Parameters
    ----------
    numbers
        By name, (M,) columns of numbers.
    ids
        By name, (M,) ids of stations, planes, sockets and targets.
    component
        (M,) the one number that a row stands for; -1 where it stands for all.
    known
        By name, the ids that the column had in all rows that were read, of which these may be some.
    """

    numbers: dict[str, Floats]
    ids: dict[str, Column]
    component: npt.NDArray[np.int64]
    known: Mapping[str, tuple[str, ...]]

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.component)

    @staticmethod
    def of(rows: InstrumentRows, index: int) -> Read:
        """The rows of an instrument."""
        mine = rows.rows_of(index)
        numbers, ids = {}, {}
        for name, column in rows.columns.items():
            some = column[mine]
            if column.dtype == object:
                ids[name] = some
            else:
                numbers[name] = some
        return Read(numbers, ids, rows.component[mine], rows.known[index])


class RowError(DatasetError):
    """A reading of a row, by its index among the instrument's, that can't be."""

    def __init__(self, index: int, what: str, column: str, hint: str) -> None:
        """Take the row's index; its file and line are added where they are known."""
        super().__init__(what, column=column, hint=hint)
        self.index = index


class Instrument(ABC):
    """What an instrument reads: z = h(X, u) + noise, with u the instrument's own unknowns.

    X is the pose of the platform and, where the table names passive joints (``measured_joints``), their coordinates.

    A subclass says which columns its table has (``Table``), which unknowns it has with which priors (``unknowns``), which
    numbers a reading has (``components``), and what it would read at given poses (``predicted``). Derivatives are numerical if
    a subclass does not give its own. To use an instrument of your own, pass its class:
    ``Dataset.read(folder, instruments=[MyInstrument])``.

    Parameters
    ----------
    table
        What dataset.toml says of it.
    read
        Its rows.
    robot
        The nominal robot.

    Attributes
    ----------
    up
        (3,) unit vector against gravity, base frame.
    kind
        Its name in dataset.toml.
    Table
        The keys that its ``[[instrument]]`` may have, and the columns of its table.

    Examples
    --------
    A plumb line whose height over the base is read:

    >>> from typing import ClassVar, Literal
    >>> import gtpin
    >>> class PlumbTable(gtpin.InstrumentTable):
    ...     numbers: ClassVar = ("height",)
    ...     kind: Literal["plumb"]
    >>> class Plumb(gtpin.Instrument):
    ...     kind, Table = "plumb", PlumbTable
    ...     components = (gtpin.Component("height", "m"),)
    ...     def measured(self):
    ...         return self.read.numbers["height"][:, None]
    ...     def predicted(self, poses, u):
    ...         return poses.T[:, 2:]
    """

    kind: ClassVar[str]
    Table: ClassVar[type[InstrumentTable]]
    components: tuple[Component, ...]

    def __init__(self, table: Any, read: Read, robot: Robot) -> None:
        """Take the table and the rows."""
        self.table, self.read, self.robot, self.up = table, read, robot, up_of(robot)
        self.unknowns: tuple[Unknown, ...] = tuple(self._unknowns())

    @property
    def name(self) -> str:
        """Its name in dataset.toml."""
        return str(self.table.name)

    @property
    def declared(self) -> tuple[float | None, ...]:
        """Declared sigma of each group of components; None if it is to be estimated."""
        return (self.table.sigma,) * (1 + max(c.group for c in self.components))

    def _unknowns(self) -> Sequence[Unknown]:
        """Its unknowns; none by default."""
        return ()

    def read_components(self) -> npt.NDArray[np.bool_]:
        """(M, c) which of the components each row has; all by default."""
        return np.ones((self.read.count, len(self.components)), dtype=bool)

    def row_sigmas(self) -> Floats | None:
        """(M, c) sigmas that rows declare themselves; None if they do not."""
        return None

    def counted(self) -> Floats:
        """(M, c) how many independent numbers each is: 1 by default, less where rows share one."""
        return np.ones((self.read.count, len(self.components)))

    @abstractmethod
    def measured(self) -> Floats:
        """(M, c) what was read."""

    @abstractmethod
    def predicted(self, poses: Poses, u: Floats) -> Floats:
        """(M, c) what would be read.

        Parameters
        ----------
        poses
            (M) poses of the TCP, base frame, with the coordinates of measured joints.
        u
            (k,) deviations of the unknowns from their declared values.
        """

    def minus(self, poses: Poses, u: Floats) -> Floats:
        """(M, c) measured less predicted."""
        return self.measured() - self.predicted(poses, u)

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, 6) derivative of the prediction by a shift, m, and a turn, rad, of the platform, base frame."""
        found = np.empty((len(poses), len(self.components), 6))
        for i in range(6):
            step = np.zeros(6)
            step[i] = STEP
            ways = (replace(poses, T=poses.T + s * step[:3], R=exp(s * step[3:]) @ poses.R) for s in (1.0, -1.0))
            sides = [self.minus(way, u) for way in ways]
            found[:, :, i] = -(sides[0] - sides[1]) / (2.0 * STEP)
        return found

    def by_joints(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, k) derivative of the prediction by the coordinates, rad or m, of ``poses.joints``, in their order."""
        found = np.zeros((len(poses), len(self.components), len(poses.joints)))
        for i, (name, x) in enumerate(poses.joints.items()):
            if name in self.table.measured_joints:
                ways = (replace(poses, joints={**poses.joints, name: x + s * STEP}) for s in (1.0, -1.0))
                sides = [self.minus(way, u) for way in ways]
                found[:, :, i] = -(sides[0] - sides[1]) / (2.0 * STEP)
        return found

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, k) derivative of the prediction by the unknowns."""
        found = np.empty((len(poses), len(self.components), len(self.unknowns)))
        for i in range(len(u)):
            step = np.zeros(len(u))
            step[i] = STEP
            found[:, :, i] = -(self.minus(poses, u + step) - self.minus(poses, u - step)) / (2.0 * STEP)
        return found

    def looked_at(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3) the point of the platform that is looked at or touches, base frame, m; the TCP by default."""
        return poses.T

    def start(self, nominal: Poses) -> Floats:
        """(k,) first guess of the unknowns' deviations from the nominal poses (M), base frame; zeros by default."""
        return np.zeros(len(self.unknowns))

    def check(self) -> None:  # noqa: B027
        """Raise `RowError` for readings that can't be; accept all by default."""
