"""Commands along circles about the pivot of a ball bar: in both directions, in several planes."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.instruments.gauge import ONE, Layout
from gtpin.bench.simulator.instruments.touch import PlainWay
from gtpin.bench.simulator.machine import Moved
from gtpin.errors import UnreachableError
from gtpin.typing import Floats

LONGEST, SHARE = 0.3, 0.6
"""Largest length of the bar: in m, and over the half extent of the workspace along the axes of its circles."""
SHORTER = (1.0, 0.7, 0.5, 0.35)
"""Lengths that are tried, over the largest."""
FLAT = 0.1
"""Half extent of a workspace along an axis, over the largest, below which no circle spans this axis."""
PLANES = ((0, 1), (0, 2), (1, 2))
"""Axes of the layout that span the circles."""
FEED = 0.02
"""Speed of the target along the circle, m/s."""
ROUNDS, CLOSED = 30, 1e-9
SINGULAR = 1e-3


def circles(
    nominal: Moved, layout: Layout, pool: Floats, ranges: tuple[Floats, Floats], count: int
) -> tuple[Floats, Floats]:
    """(M, n) commands along circles of the nominal machine, m or rad, and (M, n) their speeds, m/s or rad/s.

    There are at least ``count`` commands, in the order of travel: each circle once in one direction and once in the other.

    Raises UnreachableError if the robot can't move along any such circles.
    """
    wide = layout.half > FLAT * layout.half.max()
    planes = [plane for plane in PLANES if wide[list(plane)].all()]
    if not planes:
        raise _stuck()
    radius = min(LONGEST, SHARE * float(layout.half[wide].min()))
    for shorter in SHORTER:
        try:
            return _all_round(nominal, layout, planes, pool, ranges, shorter * radius, count)
        except UnreachableError:
            continue
    raise _stuck()


def _all_round(
    nominal: Moved,
    layout: Layout,
    planes: list[tuple[int, int]],
    pool: Floats,
    ranges: tuple[Floats, Floats],
    radius: float,
    count: int,
) -> tuple[Floats, Floats]:
    """Circles of one radius, m; see :func:`circles`."""
    points = max(8, -(-count // (2 * len(planes))))
    angles = 2.0 * np.pi * np.arange(points) / points
    first, second = (np.array([layout.axes[plane[i]] for plane in planes]) for i in (0, 1))
    pivot = np.array(layout.at(0.0, 0.0, 0.0))
    # All circles are solved together, each point from the one before, so that an arm keeps its assembly mode.
    there = nominal.predict(pool)
    start = pivot + radius * first
    nearest = [int(np.argmin(np.linalg.norm(_target(there.T, there.R) - place, axis=1))) for place in start]
    q, found, speeds = pool[nearest], [], []
    for angle in angles:
        q, slope = _brought(nominal, q, pivot + radius * (np.cos(angle) * first + np.sin(angle) * second))
        tangent = np.cos(angle) * second - np.sin(angle) * first
        found.append(q)
        speeds.append(FEED * (np.linalg.pinv(slope, rcond=SINGULAR) @ tangent[..., None])[..., 0])
    ways, along = np.stack(found, axis=1), np.stack(speeds, axis=1)
    if not ((ways >= ranges[0]) & (ways <= ranges[1])).all():
        raise _stuck()
    both = [(way, speed) for w, s in zip(ways, along, strict=True) for way, speed in ((w, s), (w[::-1], -s[::-1]))]
    return np.vstack([way for way, _ in both]), np.vstack([speed for _, speed in both])


def _brought(nominal: Moved, q: Floats, places: Floats) -> tuple[Floats, Floats]:
    """(N, n) commands, near ``q``, that bring the target to ``places`` (N, 3), and (N, 3, n) the derivative of its position."""
    for _ in range(ROUNDS):
        way = PlainWay(nominal, q)
        miss = _target(way.poses.T, way.poses.R) - places
        slope = _slope(way)
        if not np.isfinite(miss).all() or not np.isfinite(slope).all():
            raise _stuck()
        if np.abs(miss).max() < CLOSED:
            return q, slope
        q = q - (np.linalg.pinv(slope, rcond=SINGULAR) @ miss[..., None])[..., 0]
    raise _stuck()


def _slope(way: PlainWay) -> Floats:
    by_command, arm = way.by_command(), way.poses.R @ np.array(ONE[""])
    return np.asarray(by_command[:, :3] + np.cross(by_command[:, 3:], arm[:, :, None], axis=1))


def _target(T: Floats, R: Floats) -> Floats:
    return np.asarray(T + R @ np.array(ONE[""]))


def _stuck() -> UnreachableError:
    return UnreachableError(
        "the robot can't go round a ball bar's circles",
        hint="use an instrument that needs no circles, or a robot that moves its target in two directions",
    )
