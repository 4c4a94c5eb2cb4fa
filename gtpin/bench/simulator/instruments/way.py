"""A machine at its stops, before anything is measured: its true poses, and their derivative by the commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, Self

import numpy as np

from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.bench.simulator.causes.cause import Cause
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.response import Plant
from gtpin.typing import Floats


class Way(Protocol):
    """A machine at N stops."""

    @property
    def q(self) -> Floats:
        """(N, n) commands."""

    @property
    def poses(self) -> Poses:
        """(N) true poses of the TCP as instruments measure them, base frame; NaN out of reach."""

    def by_command(self) -> Floats:
        """(N, 6, n) derivative of the poses, position and rotation vector, base frame, by the commands; without effects."""

    def at(self, q: Floats) -> Self:
        """The same stops with other commands q (N, n), near the present ones."""


class Moved(Protocol):
    """A machine of any kind, without effects."""

    def predict(self, q: Floats) -> Poses:
        """Poses of the TCP at commands q (N, n), base frame; NaN out of reach."""

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
    """A machine without effects, as :class:`Way`."""

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
    """A machine with effects over a day, as :class:`Way`.

    Parameters
    ----------
    plant
        The machine and its visits, which are the stops, in the order of time.
    active
        Its effects, with their amplitudes.
    jitter
        Random deviations by the repeatability, at every visit.
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
        """See :class:`Way`. The starts of the last moves shift with the commands, so that directions of approach do not
        change."""
        visits = self.plant.visits
        moved = replace(visits, q=q, before=visits.before + (q - visits.q))
        return replace(self, plant=replace(self.plant, visits=moved))
