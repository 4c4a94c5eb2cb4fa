"""The base class of the plant's instruments: what one reads of the machine, and what is hidden about it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from gtpin.data.table import Column
from gtpin.plant.poses import Poses
from gtpin.plant.rotations import exp

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int_]

NUDGE = 1e-5
"""Step of the differences by which derivatives are found, m and rad."""


@dataclass(frozen=True)
class Hidden:
    """Something about an instrument that who measures does not know.

    Parameters
    ----------
    name
        The parameter's, as in ``wire.station[A].x``.
    value
        What it really is, m or rad.
    prior
        1 sigma of what is known of it, m or rad; 0 where it is known exactly, infinite where nothing is.
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
        In dataset.toml.
    stop
        (M,) index of the machine's stop of each row.
    hidden
        What is hidden about it.
    declared
        Whether dataset.toml states its sigma.
    """

    kind: ClassVar[str]
    touches: ClassVar[bool] = False
    """Whether the machine is brought to where its readings are zero."""

    name: str
    stop: Ints
    hidden: tuple[Hidden, ...]
    declared: bool

    @property
    def truth(self) -> Floats:
        """(k,) what the hidden really is."""
        return np.array([one.value for one in self.hidden])

    @property
    @abstractmethod
    def sigma(self) -> Floats:
        """(M, c) 1 sigma of the readings' noise, m or rad."""

    @abstractmethod
    def readings(self, poses: Poses, u: Floats) -> Floats:
        """(M, c) what it reads without noise, of what is touched by how much it misses, m or rad.

        Parameters
        ----------
        poses
            (M) poses of the TCP, base frame.
        u
            (k,) values of the hidden.
        """

    @abstractmethod
    def table(self) -> dict[str, Any]:
        """The keys of its ``[[instrument]]`` besides name, kind and sigma."""

    @abstractmethod
    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """The columns of its own in its table, with errors (M, c)."""

    def described(self) -> dict[str, Any]:
        """Its ``[[instrument]]``."""
        return {"name": self.name, "kind": self.kind, **self._stated(), **self.table()}

    def _stated(self) -> dict[str, Any]:
        return {"sigma": float(self.sigma[0, 0])} if self.declared else {}

    def change(self, one: Poses, other: Poses, u: Floats, v: Floats) -> Floats:
        """(M, c) readings at some poses and hidden values less those at others."""
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
        """(M, c, 6 + k) derivative of the readings by the pose, and by the k joints that come with it."""
        by_pose = self.by_pose(poses)
        return np.concatenate([by_pose, np.zeros((*by_pose.shape[:2], len(poses.joints)))], axis=2)

    def by_hidden(self, poses: Poses) -> Floats:
        """(M, c, k) derivative of the readings by the hidden values."""
        steps = NUDGE * np.eye(len(self.hidden))
        u = self.truth
        found = [self.change(poses, poses, u + step, u - step) / (2.0 * NUDGE) for step in steps]
        return np.stack(found, axis=2) if found else np.zeros((*self.sigma.shape, 0))

    def ids(self) -> dict[str, tuple[str, ...]]:
        """The ids that its rows may have, by the field with their indices."""
        return {}

    def in_turn(self, count: int) -> Gauge:
        """The same with one row at each of ``count`` stops.

        Row i has id number i of stations and the like, in alphabetical order, again and again.
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
        """The same with some of the rows (M,)."""
        changed = {name: value[rows] for name, value in vars(self).items() if name in self.by_row()}
        return type(self)(**{**vars(self), **changed})

    @classmethod
    def by_row(cls) -> tuple[str, ...]:
        """Names of the fields with a value a row."""
        return ("stop",)
