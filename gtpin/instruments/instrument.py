"""The base class of instruments: what an instrument reads of the robot, and its unknowns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from gtpin.data.instrument_rows import InstrumentRows
from gtpin.data.instrument_tables import InstrumentTable
from gtpin.data.table import Column
from gtpin.errors import DatasetError, renamed
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Ints, Mask

STEP = 1e-6
"""Step of numerical derivatives, m and rad, of instruments that do not give their own."""


@dataclass(frozen=True)
class Unknown:
    """An unknown parameter of an instrument, which is identified together with the robot's geometry.

    Parameters
    ----------
    name
        Its name in results, beginning with the instrument's: ``wire.station[A].x``.
    unit
        ``m`` or ``rad``.
    nominal
        The declared value, in ``unit``.
    sigma
        Standard deviation of its prior about ``nominal``, in ``unit``; infinite if it has no prior.

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
        Its name in reports: ``range``, ``x``.
    unit
        ``m`` or ``rad``.
    group
        Index of its noise sigma. Components with the same index share one sigma: the three of a tracker's position have index
        0, the three of its orientation index 1.
    initial_sigma
        Sigma, in ``unit``, at which its estimation starts if none is declared.
    shown
        Whether its residuals are part of the instrument's root mean square error.

    Examples
    --------
    >>> import gtpin
    >>> gtpin.Component("height", "m").initial_sigma
    2e-05
    """

    name: str
    unit: str
    group: int = 0
    initial_sigma: float = 2e-5
    shown: bool = True
    usual = renamed("usual", "initial_sigma")


@dataclass(frozen=True, eq=False)
class Read:
    """M rows of one instrument's table.

    - ``numbers``: by name, (M,) columns of numbers.
    - ``ids``: by name, (M,) columns of ids: stations, planes, sockets, targets.
    - ``component``: (M,) index of the only component that a row holds; -1 where a row holds all components of a reading.
    - ``known``: by name of a column of ids: all ids in the instrument's whole table. The M rows may have fewer.
    """

    numbers: dict[str, Floats]
    ids: dict[str, Column]
    component: Ints
    known: Mapping[str, tuple[str, ...]]

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.component)

    @staticmethod
    def of(rows: InstrumentRows, index: int) -> Read:
        """The rows of the instrument with the index ``index`` in dataset.toml."""
        mine = rows.rows_of(index)
        numbers, ids = {}, {}
        for name, column in rows.columns.items():
            if name in rows.lacking[index]:
                continue
            some = column[mine]
            if column.dtype == object:
                ids[name] = some
            else:
                numbers[name] = some
        return Read(numbers, ids, rows.component[mine], rows.known[index])


class RowError(DatasetError):
    """An impossible reading, with the index of its row among the instrument's rows."""

    def __init__(self, index: int, what: str, column: str, hint: str) -> None:
        """Take the row's index; its file and line are added where they are known."""
        super().__init__(what, column=column, hint=hint)
        self.index = index


class Instrument(ABC):
    """The measurement equation of an instrument: z = h(X, u) + noise, with u the instrument's own unknowns.

    X is the pose of the platform and, where ``table.measured_joints`` names passive joints, their coordinates; where
    ``table.measured_links`` names links, their rotations. The instrument has M rows, c components in a reading and k unknowns.

    A subclass defines the keys and columns of its table (``Table``), its unknowns with their priors (``_unknowns``), the
    numbers of a reading (``components``) and what it would read at given poses (``predicted``). What was read (``measured``)
    are by default the columns with the components' names. Derivatives are numerical if a subclass does not give its own. To
    use an instrument of your own, pass its class: ``Dataset.read(folder, instruments=[MyInstrument])``.

    Parameters
    ----------
    table
        Its ``[[instrument]]`` section of dataset.toml, as a ``Table``.
    read
        Its M rows.
    robot
        The nominal robot.

    Attributes
    ----------
    unknowns : tuple of Unknown
        The k unknowns.
    kind
        Name of this kind of instrument: ``kind`` in dataset.toml.
    Table
        The keys that its ``[[instrument]]`` section may have, and the columns of its table of rows.
    components : tuple of Component
        The c numbers of a reading.

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
    ...     def predicted(self, poses, u):
    ...         return poses.T[:, 2:]
    """

    kind: ClassVar[str]
    Table: ClassVar[type[InstrumentTable]]
    components: tuple[Component, ...]
    _kept: Mask

    def __init__(self, table: Any, read: Read, robot: Chain) -> None:
        """Take the table and the rows."""
        self.table, self.read, self.robot = table, read, robot
        self.unknowns: tuple[Unknown, ...] = tuple(self._unknowns())

    @cached_property
    def up(self) -> Floats:
        """(3,) unit vector against gravity, base frame."""
        return self.robot.up

    @property
    def name(self) -> str:
        """Its name in dataset.toml."""
        return str(self.table.name)

    def label(self, component: Component) -> str:
        """Name of a component among those of all instruments: ``wire``, ``cup.x``; ``x`` of a single tracker."""
        parts = (self.name, component.name if len(self.components) > 1 else "")
        return ".".join(part for part in parts if part)

    @property
    def declared(self) -> tuple[float | None, ...]:
        """Declared noise sigma of each group of components, m or rad; None if it is to be estimated."""
        return (self.table.sigma,) * (1 + max(c.group for c in self.components))

    def _unknowns(self) -> Sequence[Unknown]:
        """Its unknowns; none by default."""
        return ()

    def _identified(self, unknowns: Sequence[Unknown]) -> Sequence[Unknown]:
        """The unknowns without the exact ones, whose prior has the sigma 0; :meth:`_whole` has all of them."""
        self._kept = np.array([unknown.sigma > 0.0 for unknown in unknowns], dtype=bool)
        return [unknown for unknown in unknowns if unknown.sigma > 0.0]

    def _whole(self, u: Floats) -> Floats:
        """The deviations u (k,) with zeros for exact unknowns."""
        whole = np.zeros(len(self._kept))
        whole[self._kept] = u
        return whole

    def read_components(self) -> Mask:
        """(M, c) True for the components that a row has; all by default."""
        return np.ones((self.read.count, len(self.components)), dtype=bool)

    def row_sigmas(self) -> Floats | None:
        """(M, c) sigmas that the table declares row by row, m or rad; None, the default, if it has none."""
        return None

    def counted(self) -> Floats:
        """(M, c) degrees of freedom that each number counts as: 1 by default, less where several rows share one measurement."""
        return np.ones((self.read.count, len(self.components)))

    def measured(self) -> Floats:
        """(M, c) what was read, in the units of ``components``; by default the columns that are called as these."""
        return np.column_stack([self.read.numbers[component.name] for component in self.components])

    @abstractmethod
    def predicted(self, poses: Poses, u: Floats) -> Floats:
        """(M, c) what would be read without noise, in the units of ``components``.

        Parameters
        ----------
        poses
            (M) poses of the TCP, base frame, with the rotations of measured links and the coordinates of measured joints.
        u
            (k,) deviations of the unknowns from their declared values, m or rad.
        """

    minus = renamed("minus", "residual_at")

    def residual_at(self, poses: Poses, u: Floats) -> Floats:
        """(M, c) measured less predicted; ``poses`` and ``u`` as for :meth:`predicted`."""
        return self.measured() - self.predicted(poses, u)

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, 6) derivative of the prediction by the TCP's position (m) and rotation vector (rad), base frame."""
        found = np.empty((len(poses), len(self.components), 6))
        for i, way in enumerate(STEP * np.eye(6)):
            sides = (replace(poses, T=poses.T + s * way[:3], R=exp(s * way[3:]) @ poses.R) for s in (1.0, -1.0))
            found[:, :, i] = self._slope(*((side, u) for side in sides))
        return found

    def _slope(self, ahead: tuple[Poses, Floats], behind: tuple[Poses, Floats]) -> Floats:
        """(M, c) derivative of the prediction by central differences between two states."""
        return (self.residual_at(*behind) - self.residual_at(*ahead)) / (2.0 * STEP)

    def by_links(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, 3 l) derivative of the prediction by rotation vectors, rad, base frame, of the l links in ``poses.links``."""
        found = np.zeros((len(poses), len(self.components), 3 * len(poses.links)))
        for i, (name, R) in enumerate(poses.links.items()):
            for k, way in enumerate(STEP * np.eye(3) if name in self.table.measured_links else ()):
                sides = (replace(poses, links={**poses.links, name: exp(s * way) @ R}) for s in (1.0, -1.0))
                found[:, :, 3 * i + k] = self._slope(*((side, u) for side in sides))
        return found

    def by_joints(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, j) derivative of the prediction by the coordinates, rad or m, of the j joints in ``poses.joints``."""
        found = np.zeros((len(poses), len(self.components), len(poses.joints)))
        for i, (name, x) in enumerate(poses.joints.items()):
            if name in self.table.measured_joints:
                sides = (replace(poses, joints={**poses.joints, name: x + s * STEP}) for s in (1.0, -1.0))
                found[:, :, i] = self._slope(*((side, u) for side in sides))
        return found

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, k) derivative of the prediction by the unknowns ``u``."""
        found = np.empty((len(poses), len(self.components), len(self.unknowns)))
        for i, way in enumerate(STEP * np.eye(len(u))):
            found[:, :, i] = self._slope((poses, u + way), (poses, u - way))
        return found

    def looked_at(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3) the point of the platform that the instrument observes or that touches, base frame, m; the TCP by default."""
        return poses.T

    def start(self, nominal: Poses) -> Floats:
        """(k,) first guess of the unknowns' deviations ``u``, for a fit; zeros by default.

        ``nominal``: the M poses of the nominal robot, base frame.
        """
        return np.zeros(len(self.unknowns))

    def check(self) -> None:  # noqa: B027
        """Raise `RowError` for an impossible reading; accept all readings by default."""
