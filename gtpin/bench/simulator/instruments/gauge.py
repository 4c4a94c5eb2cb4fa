"""The base class of the plant's instruments: their readings, and their unknowns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rotations import exp
from gtpin.data.table import Column
from gtpin.typing import Floats, Ints

NUDGE = 1e-5
"""Step of the central differences from which derivatives are computed, m and rad."""


@dataclass(frozen=True)
class Hidden:
    """An unknown of an instrument: the user does not know its true value.

    Parameters
    ----------
    name
        Name of the parameter, such as ``wire.station[A].x``.
    value
        Its true value, m or rad.
    prior
        Its prior standard deviation for the user, m or rad: 0 where it is known exactly, infinite where it is not known at all.
    """

    name: str
    value: float
    prior: float


@dataclass(frozen=True, eq=False)
class Gauge(ABC):
    """An instrument with M rows in its table, of c numbers each.

    Parameters
    ----------
    name
        Its name in dataset.toml.
    stop
        (M,) index of the machine's stop at which each row is read.
    hidden
        Its k unknowns.
    declared
        Whether dataset.toml states its sigma.
    """

    kind: ClassVar[str]
    touches: ClassVar[bool] = False
    """Whether it is touched: the machine moves to where its readings are zero."""

    name: str
    stop: Ints
    hidden: tuple[Hidden, ...]
    declared: bool

    @property
    def truth(self) -> Floats:
        """(k,) true values of the unknowns."""
        return np.array([one.value for one in self.hidden])

    @property
    @abstractmethod
    def sigma(self) -> Floats:
        """(M, c) standard deviation of the readings' noise, m or rad."""

    @abstractmethod
    def readings(self, poses: Poses, u: Floats) -> Floats:
        """(M, c) readings without noise, m or rad; for a touched instrument, the distance of the target from it.

        Parameters
        ----------
        poses
            (M) poses of the TCP, base frame.
        u
            (k,) values of the unknowns.
        """

    @abstractmethod
    def table(self) -> dict[str, Any]:
        """The keys of its ``[[instrument]]`` in dataset.toml, without name, kind and sigma."""

    @abstractmethod
    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """The instrument's columns in its table, with errors (M, c) of the readings."""

    def described(self) -> dict[str, Any]:
        """Its ``[[instrument]]`` in dataset.toml."""
        return {"name": self.name, "kind": self.kind, **self._stated(), **self.table()}

    def _stated(self) -> dict[str, Any]:
        return {"sigma": float(self.sigma[0, 0])} if self.declared else {}

    def change(self, one: Poses, other: Poses, u: Floats, v: Floats) -> Floats:
        """(M, c) readings at poses ``one`` and unknowns ``u``, less those at poses ``other`` and unknowns ``v``."""
        return self.readings(one, u) - self.readings(other, v)

    def by_pose(self, poses: Poses) -> Floats:
        """(M, c, 6) derivative of the readings by the pose: position and rotation vector, base frame."""
        found = []
        for step in NUDGE * np.eye(6):
            turn = exp(step[3:])
            there, back = Poses(poses.T + step[:3], turn @ poses.R), Poses(poses.T - step[:3], turn.T @ poses.R)
            found.append(self.change(there, back, self.truth, self.truth) / (2.0 * NUDGE))
        return np.stack(found, axis=2)

    def by_motion(self, poses: Poses) -> Floats:
        """(M, c, 6 + k) derivative of the readings by the pose, and by the k joints whose coordinates the poses have."""
        by_pose = self.by_pose(poses)
        return np.concatenate([by_pose, np.zeros((*by_pose.shape[:2], len(poses.joints)))], axis=2)

    def by_hidden(self, poses: Poses) -> Floats:
        """(M, c, k) derivative of the readings by the unknowns."""
        steps = NUDGE * np.eye(len(self.hidden))
        u = self.truth
        found = [self.change(poses, poses, u + step, u - step) / (2.0 * NUDGE) for step in steps]
        return np.stack(found, axis=2) if found else np.zeros((*self.sigma.shape, 0))

    def ids(self) -> dict[str, tuple[str, ...]]:
        """Ids of stations, planes, sockets or targets, by the name of the field that has each row's index."""
        return {}

    def in_turn(self, count: int) -> Gauge:
        """The instrument with one row at each of ``count`` stops.

        The rows have the ids of stations, planes, sockets or targets in alphabetical order, repeated.
        """
        turns: dict[str, Any] = {"stop": np.arange(count)}
        for name in (name for name in self.by_row() if name != "stop"):
            if name in self.ids():
                order = np.argsort(np.array(self.ids()[name]))
                turns[name] = order[np.arange(count) % len(order)]
            else:
                turns[name] = np.tile(np.median(getattr(self, name), axis=0), (count, 1))
        return type(self)(**{**vars(self), **turns})

    def kept(self, rows: npt.NDArray[np.bool_]) -> Gauge:
        """The instrument with only some of its rows; ``rows`` (M,) is a mask."""
        changed = {name: value[rows] for name, value in vars(self).items() if name in self.by_row()}
        return type(self)(**{**vars(self), **changed})

    @classmethod
    def by_row(cls) -> tuple[str, ...]:
        """Names of the fields with one value for each row."""
        return ("stop",)
