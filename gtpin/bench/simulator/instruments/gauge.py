"""The base classes of the simulator's instruments: what they read, their unknowns, their targets, and where they stand."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from gtpin.bench.simulator.poses import AXES, VirtualPoses, across, exp
from gtpin.data.table import Column
from gtpin.typing import Floats, Ints, Mask

Place = tuple[float, float, float]

NUDGE = 1e-5
"""Step of the central differences from which derivatives are computed, m and rad."""
TARGET_SIGMA = 1e-4
"""Standard deviation of a target's position, per axis, m: from a drawing and the errors of assembly."""
ONE: dict[str, Place] = {"": (0.02, -0.03, 0.05)}
"""A single target, TCP frame, m; its id is empty."""
THREE: dict[str, Place] = {"A": (0.06, 0.0, 0.01), "B": (-0.03, 0.05, 0.02), "C": (-0.03, -0.05, 0.06)}
"""Three targets, from which the platform's orientation can be determined, TCP frame, m."""


@dataclass(frozen=True)
class Hidden:
    """An unknown of an instrument: the user does not know its true value."""

    name: str  # Name of the parameter, such as ``wire.station[A].x``
    value: float  # Its true value, m or rad
    prior: float  # Its prior standard deviation for the user, m or rad: 0 where known, infinite where not at all


def hidden(stem: str, values: Iterable[float], prior: float, axes: Iterable[str] = AXES) -> list[Hidden]:
    """The unknowns ``STEM.x`` and so on, with one prior."""
    return [Hidden(f"{stem}.{axis}", float(value), prior) for axis, value in zip(axes, values, strict=False)]


@dataclass(frozen=True, eq=False)
class Gauge(ABC):
    """An instrument with M rows in its table, of c numbers each."""

    kind: ClassVar[str]
    touches: ClassVar[bool] = False
    """Whether it is touched: the machine moves to where its readings are zero."""
    reads: ClassVar[tuple[str, ...]] = ()
    """Columns of the readings in its table."""
    by_row: ClassVar[Mapping[str, str]] = {}
    """Fields with an index for each row, and the fields with the ids of the stations, planes or targets that are meant."""

    name: str  # Its name in dataset.toml
    stop: Ints  # (M,) index of the machine's stop at which each row is read
    hidden: tuple[Hidden, ...]  # Its k unknowns
    declared: bool  # Whether dataset.toml states its sigma
    sigma: Floats  # (M, c) standard deviation of the readings' noise, m or rad
    # Its own columns in its table, once it has read; ``stop`` gives the others
    columns: dict[str, Column] = field(default_factory=dict, kw_only=True)

    @property
    def truth(self) -> Floats:
        """(k,) true values of the unknowns."""
        return np.array([one.value for one in self.hidden])

    def scattered(self, by_motion: Floats, jitter: Floats) -> Floats:
        """(M, c) sigma of the readings with the scatter of the machine.

        ``by_motion`` (M, c, 6 + k) as :meth:`by_motion` gives it; ``jitter`` (M, 6 + k, n): motions by 1 sigma of each drive.
        """
        return np.asarray(np.sqrt(self.sigma**2 + ((by_motion @ jitter) ** 2).sum(axis=2)))

    @abstractmethod
    def readings(self, poses: VirtualPoses, u: Floats) -> Floats:
        """(M, c) readings without noise, m or rad, at poses (M) of the TCP, base frame, for values ``u`` (k,) of the unknowns.

        For a touched instrument, the distance of the target from it.
        """

    def change(self, one: VirtualPoses, other: VirtualPoses, u: Floats, v: Floats) -> Floats:
        """(M, c) readings at poses ``one`` and unknowns ``u``, less those at poses ``other`` and unknowns ``v``."""
        return self.readings(one, u) - self.readings(other, v)

    # -------------------------------------------------------------------------------------------- in the files

    @property
    def described(self) -> dict[str, Any]:
        """Its ``[[instrument]]`` in dataset.toml."""
        return {"name": self.name, "kind": self.kind, **(self.stated() if self.declared else {}), **self.table()}

    def stated(self) -> dict[str, float]:
        """The keys with its sigma."""
        return {"sigma": float(self.sigma[0, 0])}

    def table(self) -> dict[str, Any]:
        """All other keys."""
        return {}

    def recorded(self, poses: VirtualPoses, errors: Floats) -> dict[str, Column]:
        """Its columns in its table at poses (M), with errors (M, c) of the readings."""
        return self.ids | dict(zip(self.reads, (self.readings(poses, self.truth) + errors).T, strict=False))

    @property
    def ids(self) -> dict[str, Column]:
        """The columns with the station, plane or target of each row."""
        known = {name: list(getattr(self, of)) for name, of in self.by_row.items()}
        several = {name: np.array(ids, dtype=object) for name, ids in known.items() if ids != [""]}
        return {name: ids[getattr(self, name)] for name, ids in several.items()}

    # --------------------------------------------------------------------------------------------- derivatives

    def by_pose(self, poses: VirtualPoses) -> Floats:
        """(M, c, 6) derivative of the readings by the pose: position and rotation vector, base frame."""
        found = []
        for step in NUDGE * np.eye(6):
            turn = exp(step[3:])
            there = VirtualPoses(poses.T + step[:3], turn @ poses.R)
            back = VirtualPoses(poses.T - step[:3], turn.T @ poses.R)
            found.append(self.change(there, back, self.truth, self.truth) / (2.0 * NUDGE))
        return np.stack(found, axis=2)

    def by_motion(self, poses: VirtualPoses) -> Floats:
        """(M, c, 6 + k) derivative of the readings by the pose, and by the k joints whose coordinates the poses have."""
        by_pose = self.by_pose(poses)
        return np.concatenate([by_pose, np.zeros((*by_pose.shape[:2], len(poses.joints)))], axis=2)

    def by_hidden(self, poses: VirtualPoses) -> Floats:
        """(M, c, k) derivative of the readings by the unknowns."""
        u = self.truth
        found = [self.change(poses, poses, u + s, u - s) / (2.0 * NUDGE) for s in NUDGE * np.eye(len(u))]
        return np.stack(found, axis=2) if found else np.zeros((*self.sigma.shape, 0))

    # ----------------------------------------------------------------------------------------------- other rows

    def in_turn(self, count: int) -> Self:
        """The instrument with one row at each of ``count`` stops, with its ids in alphabetical order, repeated."""
        orders = {name: np.argsort(np.array(list(getattr(self, of)))) for name, of in self.by_row.items()}
        turns: dict[str, Any] = {name: order[np.arange(count) % len(order)] for name, order in orders.items()}
        sigma = np.tile(np.median(self.sigma, axis=0), (count, 1))
        return replace(self, stop=np.arange(count), sigma=sigma, **turns)

    def take(self, rows: Ints | Mask) -> Self:
        """The instrument with some of its rows, by their indices or a mask."""
        changed: dict[str, Any] = {name: getattr(self, name)[rows] for name in ("stop", "sigma", *self.by_row)}
        return replace(self, **changed, columns={name: x[rows] for name, x in self.columns.items()})


@dataclass(frozen=True, eq=False)
class Targeted(Gauge):
    """An instrument that measures ``targets``: points on the platform, declared in the TCP frame, m, by id."""

    targets: dict[str, Place]

    def table(self) -> dict[str, Any]:
        points = {name: list(point) for name, point in self.targets.items()}
        return {"target_sigma": TARGET_SIGMA, **({"target": points[""]} if "" in points else {"targets": points})}

    def positions(self, poses: VirtualPoses, u: Floats, which: Ints | int = 0) -> Floats:
        """(M, 3) positions of the targets ``which`` (M,), m, base frame."""
        local = u[: 3 * len(self.targets)].reshape(-1, 3)[np.broadcast_to(which, len(poses))]
        return np.asarray(poses.T + np.einsum("nij,nj->ni", poses.R, local))

    def others(self, u: Floats) -> Floats:
        """The unknowns without those of the targets, which come first."""
        return u[3 * len(self.targets) :]


def drawn_targets(instrument: str, targets: dict[str, Place], rng: np.random.Generator) -> list[Hidden]:
    """True positions of the targets, TCP frame: three unknowns each."""
    found = []
    for name, point in targets.items():
        stem = f"{instrument}.target{f'[{name}]' if name else ''}"
        found += hidden(stem, point + TARGET_SIGMA * rng.standard_normal(3), TARGET_SIGMA)
    return found


@dataclass(frozen=True, eq=False)
class Layout:
    """The workspace of a robot."""

    centre: Floats  # (3,) its centre, base frame, m
    axes: Floats  # (3, 3) rows: two level directions, and up (against gravity), base frame
    half: Floats  # (3,) half its extent along the axes, m
    freedoms: int  # Number of commands

    @staticmethod
    def of(poses: VirtualPoses, gravity: Floats, freedoms: int) -> Layout:
        """The workspace that some poses of the TCP fill, from the 5th to the 95th percentile of their coordinates."""
        size = float(np.linalg.norm(gravity))
        up = 0.0 - gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
        axes = np.vstack([across(up), up])
        low, high = np.percentile(poses.T @ axes.T, (5.0, 95.0), axis=0)
        return Layout((low + high) / 2.0 @ axes, axes, (high - low) / 2.0, freedoms)

    @property
    def up(self) -> Floats:
        """(3,) unit vector against gravity, base frame."""
        return np.asarray(self.axes[2])

    @property
    def radius(self) -> float:
        """Radius of the sphere that contains the workspace, m."""
        return float(np.linalg.norm(self.half))

    def at(self, *shares: float) -> Place:
        """A place in the workspace, base frame, m, rounded to 1 mm; ``shares``: of the half extents along the axes."""
        return _rounded(self.centre + (np.array(shares) * self.half) @ self.axes)

    def around(self, angle: float, height: float, distance: float) -> Place:
        """A place, base frame, in a direction, rad, at a height above the centre and at a horizontal distance from it, m."""
        level = np.cos(angle) * self.axes[0] + np.sin(angle) * self.axes[1]
        return _rounded(self.centre + distance * level + height * self.up)


def _rounded(place: Floats) -> Place:
    x, y, z = (float(value) for value in np.round(place, 3) + 0.0)
    return x, y, z
