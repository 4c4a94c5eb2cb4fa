"""Commands at which a machine touches: solved until the true machine, with all its errors, is where the row says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from gtpin.errors import UnreachableError
from gtpin.plant.instruments.gauge import Gauge
from gtpin.plant.instruments.way import Moved, PlainWay, Way
from gtpin.plant.poses import Poses

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int_]
Bools = npt.NDArray[np.bool_]
AWay = TypeVar("AWay", bound=Way)

ROUNDS = 40
EXACT = 2e-10
"""What a touch may miss by, m; deflections agree to half of that."""
FARTHEST = 0.3
"""Longest change of a command in a round, m or rad."""
SPARE = 3
"""So many starts for each touch that is wanted."""
ROOM = 1e-2
"""Share of a command's range at either end at which nobody touches."""
SINGULAR = 1e-3
"""Smallest singular value, over the largest, of the target's motion by the commands that counts."""


def begun(
    gauge: Gauge, machine: Moved, pool: Floats, ranges: tuple[Floats, Floats], rng: np.random.Generator
) -> Floats:
    """(M, n) commands at which a machine without effects makes the touches of a gauge's rows.

    Parameters
    ----------
    pool
        (P, n) commands all over the workspace, to start from the nearest.
    ranges
        (n,) lower and upper ends of the commands.

    Raises
    ------
    UnreachableError
        If it can't make some of them.
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
    """A way whose stops touch, and (N,) which of them do; stops of no gauge stay.

    Parameters
    ----------
    gauges
        Those that are touched, each at stops of its own.
    errors
        (M, c) by how much each touch misses, of each gauge.
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
    """(M, a) what each row is to touch with what."""
    return np.column_stack([getattr(gauge, name) for name in gauge.by_row() if name != "stop"])


def _all_like(gauge: Gauge, row: int, count: int) -> Gauge:
    """A gauge all of whose rows, one at each of so many stops, ask for the same as one of its rows."""
    same = {name: np.full(count, getattr(gauge, name)[row]) for name in gauge.by_row()}
    return type(gauge)(**{**vars(gauge), **same, "stop": np.arange(count)})


def _inside(ranges: tuple[Floats, Floats], q: Floats) -> Bools:
    lower, upper = ranges
    room = np.where(np.isfinite(upper - lower), ROOM * (upper - lower), 0.0)
    return np.asarray(((q >= lower + room) & (q <= upper - room)).all(axis=1))
