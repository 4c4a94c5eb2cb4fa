"""Commands of touches: solved so that the true machine, with all its errors, touches what each row names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.instruments.way import Moved, PlainWay, Way
from gtpin.bench.simulator.poses import Poses
from gtpin.errors import UnreachableError
from gtpin.typing import Floats, Ints

Bools = npt.NDArray[np.bool_]
AWay = TypeVar("AWay", bound=Way)

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


def begun(
    gauge: Gauge, machine: Moved, pool: Floats, ranges: tuple[Floats, Floats], rng: np.random.Generator
) -> Floats:
    """(M, n) commands, m or rad, at which a machine without effects makes the touches of an instrument's rows.

    Parameters
    ----------
    pool
        (P, n) commands all over the workspace; the solution starts from the nearest.
    ranges
        (n,) lower and upper ends of the commands.

    Raises
    ------
    UnreachableError
        If the machine can't make some of the touches.
    """
    alike, which = np.unique(_asked(gauge), axis=0, return_inverse=True)
    found = np.empty((len(gauge.stop), pool.shape[1]))
    there = PlainWay(machine, pool).poses
    for i in range(len(alike)):
        rows = np.flatnonzero(which.ravel() == i)
        misses = np.linalg.norm(_all_like(gauge, int(rows[0]), len(pool)).readings(there, gauge.truth), axis=1)
        nearest = np.argsort(misses)[: SPARE * len(rows)]
        some = _all_like(gauge, int(rows[0]), len(nearest))
        solved, good = _felt(PlainWay(machine, pool[rng.permutation(nearest)]), [some], np.zeros_like(some.sigma))
        good &= _inside(ranges, solved.q)
        if good.sum() < len(rows):
            raise UnreachableError(
                f"the target does not get to all of {gauge.name}'s {gauge.kind}s",
                hint="use an instrument that needs no touch, or a robot that can move its target in three directions",
            )
        found[rows] = solved.q[good][: len(rows)]
    return found


def felt(way: AWay, gauges: Sequence[Gauge], errors: Sequence[Floats]) -> tuple[AWay, Bools]:
    """The stops of ``way`` with commands solved so that they touch, and (N,) which of them do; other stops are unchanged.

    Parameters
    ----------
    gauges
        The touched instruments, each with its own stops.
    errors
        For each instrument, (M, c) errors of its touches: the readings that are solved for, m.
    """
    return _felt(way, gauges, np.concatenate([e.ravel() for e in errors]) if errors else np.zeros(0))


def _felt(way: AWay, gauges: Sequence[Gauge], errors: Floats) -> tuple[AWay, Bools]:
    aims, at = [], 0
    for gauge in gauges:
        aims.append(errors.ravel()[at : at + gauge.sigma.size].reshape(gauge.sigma.shape))
        at += gauge.sigma.size
    good = np.ones(len(way.q), dtype=bool)
    going = True
    for _ in range(ROUNDS if gauges else 0):
        q, by_command, going = way.q.copy(), way.by_command(), False
        for gauge, aim in zip(gauges, aims, strict=True):
            miss, slope = _slope(gauge, way.poses, by_command)
            miss -= aim
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


def _slope(gauge: Gauge, poses: Poses, by_command: Floats) -> tuple[Floats, Floats]:
    """(M, c) readings and (M, c, n) their derivative by the commands."""
    here = poses[gauge.stop]
    return gauge.readings(here, gauge.truth), gauge.by_pose(here) @ by_command[gauge.stop]


def _asked(gauge: Gauge) -> Ints:
    """(M, a) indices of what each row touches, and with which target."""
    return np.column_stack([getattr(gauge, name) for name in gauge.by_row() if name != "stop"])


def _all_like(gauge: Gauge, row: int, count: int) -> Gauge:
    """An instrument with ``count`` rows that all touch the same as row ``row``, each at its own stop."""
    same = {name: np.full(count, getattr(gauge, name)[row]) for name in gauge.by_row()}
    return type(gauge)(**{**vars(gauge), **same, "stop": np.arange(count)})


def _inside(ranges: tuple[Floats, Floats], q: Floats) -> Bools:
    lower, upper = ranges
    room = np.where(np.isfinite(upper - lower), ROOM * (upper - lower), 0.0)
    return np.asarray(((q >= lower + room) & (q <= upper - room)).all(axis=1))
