"""A machine at its stops, before anything is measured: its true poses, and what other commands would do to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt

from gtpin.plant.arms.machine import ArmMachine
from gtpin.plant.causes.cause import Cause
from gtpin.plant.poses import Poses
from gtpin.plant.response import Plant

Floats = npt.NDArray[np.float64]


class Way(Protocol):
    """N stops."""

    @property
    def q(self) -> Floats:
        """(N, n) commands."""

    @property
    def poses(self) -> Poses:
        """(N) true poses of the TCP as instruments see them, base frame; NaN out of reach."""

    def by_command(self) -> Floats:
        """(N, 6, n) their derivative by the commands, less small effects: position and rotation vector, base frame."""

    def at(self, q: Floats) -> Self:
        """The same stops with other commands, near by."""


class Moved(Protocol):
    """A machine without effects, of any kind."""

    def predict(self, q: Floats) -> Poses:
        """Poses of the TCP at commands q (N, n), base frame; NaN where it can't go."""

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6, n) derivative of the poses by the commands: position and rotation vector, base frame."""


@dataclass(frozen=True, eq=False)
class AnArm:
    """An arm as :class:`Moved`."""

    machine: ArmMachine

    def predict(self, q: Floats) -> Poses:
        """See :class:`Moved`."""
        return self.machine.forward(q)

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """See :class:`Moved`."""
        return self.machine.command_jacobian(q)


@dataclass(frozen=True, eq=False)
class PlainWay:
    """A machine without effects."""

    machine: Moved
    q: Floats

    @cached_property
    def poses(self) -> Poses:
        """See :class:`Way`."""
        return self.machine.predict(self.q)

    def by_command(self) -> Floats:
        """See :class:`Way`."""
        found = np.full((*self.poses.T.shape[:1], 6, self.q.shape[1]), np.nan)
        there = self.poses.reached
        found[there] = self.machine.command_jacobian(self.q[there], self.poses[there])
        return found

    def at(self, q: Floats) -> Self:
        """See :class:`Way`."""
        return replace(self, q=q)


@dataclass(frozen=True, eq=False)
class DayWay:
    """A machine with effects in the course of a day.

    Parameters
    ----------
    plant
        The machine and its visits: these are the stops, in the order of time.
    active
        What it has.
    jitter
        What goes by nothing at every visit.
    """

    plant: Plant
    active: Sequence[tuple[Cause, float]]
    jitter: Any

    @property
    def q(self) -> Floats:
        """See :class:`Way`."""
        return self.plant.visits.q

    @cached_property
    def poses(self) -> Poses:
        """See :class:`Way`."""
        return self.plant.seen(self.active, self.jitter)

    def by_command(self) -> Floats:
        """See :class:`Way`."""
        return self.plant.by_command()[:, :6]

    def at(self, q: Floats) -> Self:
        """See :class:`Way`; last moves begin as far off as before, so that directions stay."""
        visits = self.plant.visits
        moved = replace(visits, q=q, before=visits.before + (q - visits.q))
        return replace(self, plant=replace(self.plant, visits=moved))
