"""Commands of touches: solved so that the true machine, with all its errors, touches what each row names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, Self, TypeVar

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.causes.cause import Cause
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.machine import Moved
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.response import Response
from gtpin.errors import UnreachableError
from gtpin.typing import Floats

Bools = npt.NDArray[np.bool_]
AWay = TypeVar("AWay", bound="Way")

ROUNDS = 40
EXACT = 2e-10
"""Largest error of a solved touch, m; deflections are solved to half of it."""
FARTHEST = 0.3
"""Largest change of a command in one step of Newton's method, m or rad."""
SPARE = 3
"""Number of starting points for each wanted touch."""
ROOM = 1e-2
"""Share of a command's range, at either end, without touches."""
SINGULAR = 1e-3
"""Singular values of the readings' derivative by the commands below this share of the largest count as zero."""


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


@dataclass(frozen=True, eq=False)
class PlainWay:
    """A machine without effects, as :class:`Way`."""

    machine: Moved
    q: Floats

    @cached_property
    def poses(self) -> Poses:
        return self.machine.predict(self.q)

    def by_command(self) -> Floats:
        found = np.full((*self.poses.T.shape[:1], 6, self.q.shape[1]), np.nan)
        there = self.poses.reached
        found[there] = self.machine.command_jacobian(self.q[there], self.poses[there])
        return found

    def at(self, q: Floats) -> Self:
        return replace(self, q=q)


@dataclass(frozen=True, eq=False)
class DayWay:
    """A machine with effects over a day, as :class:`Way`."""

    response: Response  # The machine and its visits, which are the stops, in the order of time
    active: Sequence[tuple[Cause, float]]  # Its effects, with their amplitudes
    jitter: Deviation  # Random deviations by the repeatability, at every visit

    @property
    def q(self) -> Floats:
        return self.response.visits.q

    @cached_property
    def poses(self) -> Poses:
        return self.response.seen(self.active, self.jitter)

    def by_command(self) -> Floats:
        return self.response.by_command()[:, :6]

    def at(self, q: Floats) -> Self:
        # The starts of the last moves shift with the commands, so that directions of approach do not change.
        visits = self.response.visits
        moved = replace(visits, q=q, before=visits.before + (q - visits.q))
        return replace(self, response=replace(self.response, visits=moved))


def begun(
    gauge: Gauge, machine: Moved, pool: Floats, ranges: tuple[Floats, Floats], rng: np.random.Generator
) -> Floats:
    """(M, n) commands, m or rad, at which a machine without effects makes the touches of an instrument's rows.

    ``pool``: (P, n) commands all over the workspace; the solution starts from the nearest. ``ranges``: (n,) lower and upper
    ends of the commands. ``Raises UnreachableError if the machine can't make some of the touches.``: .
    """
    asked = np.column_stack(
        [getattr(gauge, name) for name in gauge.by_row]
    )  # what each row touches, and with which target
    alike, which = np.unique(asked, axis=0, return_inverse=True)
    found = np.empty((len(gauge.stop), pool.shape[1]))
    there = machine.predict(pool)
    lower, upper = ranges
    room = np.where(np.isfinite(upper - lower), ROOM * (upper - lower), 0.0)
    for i in range(len(alike)):
        rows = np.flatnonzero(which.ravel() == i)
        every = gauge.all_like(int(rows[0]), len(pool))
        misses = np.linalg.norm(every.readings(there, gauge.truth), axis=1)
        nearest = np.argsort(misses)[: SPARE * len(rows)]
        some = gauge.all_like(int(rows[0]), len(nearest))
        solved, good = felt(PlainWay(machine, pool[rng.permutation(nearest)]), [some], [np.zeros_like(some.sigma)])
        good &= ((solved.q >= lower + room) & (solved.q <= upper - room)).all(axis=1)
        if good.sum() < len(rows):
            raise UnreachableError(
                f"the target does not get to all of {gauge.name}'s {gauge.kind}s",
                hint="use an instrument that needs no touch, or a robot that can move its target in three directions",
            )
        found[rows] = solved.q[good][: len(rows)]
    return found


def felt(way: AWay, gauges: Sequence[Gauge], errors: Sequence[Floats]) -> tuple[AWay, Bools]:
    """The stops of ``way`` with commands solved so that the touched ones of some instruments are touched, and (N,) which of
    them are; other stops are unchanged.

    ``errors``: for each instrument, (M, c) errors of its touches: the readings that are solved for, m.
    """
    touching = [(gauge, error) for gauge, error in zip(gauges, errors, strict=True) if gauge.touches]
    good = np.ones(len(way.q), dtype=bool)
    for _ in range(ROUNDS if touching else 0):
        q, by_command, going = way.q.copy(), way.by_command(), False
        for gauge, aim in touching:
            here = way.poses[gauge.stop]
            miss, slope = gauge.readings(here, gauge.truth) - aim, gauge.by_pose(here) @ by_command[gauge.stop]
            off = ~(np.abs(miss).max(axis=1) < EXACT)  # NaN is off
            good[gauge.stop] = ~off
            lost = ~np.isfinite(slope).all(axis=(1, 2)) | ~np.isfinite(miss).all(axis=1)
            move = off & ~lost
            step = -(np.linalg.pinv(slope[move], rcond=SINGULAR) @ miss[move][..., None])[..., 0]
            longest = np.abs(step).max(axis=1, keepdims=True)
            q[gauge.stop[move]] += step * np.minimum(1.0, FARTHEST / np.maximum(longest, 1e-300))
            going |= bool(move.any())
        if not going:
            break
        way = way.at(q)
    return way, good
