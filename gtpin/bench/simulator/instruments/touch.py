"""Instruments that are touched (planes, sockets for a ball), and commands that touch them or go round circles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from gtpin.bench.simulator.instruments.gauge import (
    ONE,
    THREE,
    Gauge,
    Hidden,
    Layout,
    Place,
    Targeted,
    drawn_targets,
    hidden,
)
from gtpin.bench.simulator.machine import Moved
from gtpin.bench.simulator.poses import VirtualPoses, across, exp
from gtpin.errors import UnreachableError
from gtpin.typing import Floats, Ints, Mask

HEIGHT_SIGMA, NORMAL_SIGMA = 5e-3, 5e-3
"""Standard deviations of planes' errors, m and rad: the prior sigmas that a dataset has by default."""
APART, TILTED = 0.5, 0.35
"""Heights of the level planes, in half heights of the workspace, and the tilt of the third, rad."""
CORNERS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
"""Directions of the sockets from the centre, by axis of the layout."""
DISTANCE_SIGMA = 5e-5
"""Standard deviation of the known distance between two sockets, m."""


@dataclass(frozen=True, eq=False)
class VirtualPlane(Targeted):
    """z = n . (p - point) - height, with target p, and the plane's normal n and a point of it."""

    kind: ClassVar[str] = "plane"
    touches: ClassVar[bool] = True
    by_row: ClassVar[dict[str, str]] = {"plane": "planes"}

    planes: dict[str, tuple[Place, Floats]]  # The declared planes by id: a point, m, and a unit normal, base frame
    plane: Ints  # (M,) index of each row's plane

    @staticmethod
    def drawn(layout: Layout, stops: Ints, declared: bool, rng: np.random.Generator) -> VirtualPlane:
        """Two level planes at different heights, and a tilted one, touched in turn."""
        tilted = np.sin(TILTED) * layout.axes[0] + np.cos(TILTED) * layout.up
        planes = {
            "low": (layout.at(0.0, 0.0, -APART), layout.up),
            "high": (layout.at(0.0, 0.0, APART), layout.up),
            "tilted": (layout.at(0.0, 0.0, 0.0), tilted),
        }
        priors = {"height": HEIGHT_SIGMA, "a": NORMAL_SIGMA, "b": NORMAL_SIGMA}
        off = [
            Hidden(f"bed.plane[{plane}].{what}", prior * rng.standard_normal(), prior)
            for plane in planes
            for what, prior in priors.items()
        ]
        unknown, sigma = (*drawn_targets("bed", ONE, rng), *off), np.full((len(stops), 1), 1e-5)
        return VirtualPlane("bed", stops, unknown, declared, sigma, ONE, planes, np.arange(len(stops)) % len(planes))

    def readings(self, poses: VirtualPoses, u: Floats) -> Floats:
        height, a, b = self.others(u).reshape(-1, 3)[self.plane].T
        points = np.array([point for point, _ in self.planes.values()])[self.plane]
        normals = np.array([normal for _, normal in self.planes.values()])
        sideways = np.array([across(normal) for normal in normals])[self.plane]
        turned = exp(a[:, None] * sideways[:, 0] + b[:, None] * sideways[:, 1]) @ normals[self.plane][..., None]
        p = self.positions(poses, u)
        return np.asarray(np.einsum("ni,ni->n", turned[..., 0], p - points) - height)[:, None]

    def table(self) -> dict[str, Any]:
        planes = {name: {"point": list(p), "normal": n.tolist()} for name, (p, n) in self.planes.items()}
        return {**super().table(), "planes": planes}


@dataclass(frozen=True, eq=False)
class VirtualSocket(Targeted):
    """z = p - s, with target p and socket s, m."""

    kind: ClassVar[str] = "socket"
    touches: ClassVar[bool] = True
    by_row: ClassVar[dict[str, str]] = {"socket": "sockets", "target": "targets"}

    sockets: tuple[str, ...]  # Ids of the sockets; their positions are unknown to the user
    distance: float  # Declared distance between the first two sockets, m
    # `socket`, `target`: (M,) indices of each row's socket and target
    socket: Ints
    target: Ints

    @staticmethod
    def drawn(layout: Layout, stops: Ints, declared: bool, rng: np.random.Generator) -> VirtualSocket:
        """Four sockets in the workspace; three targets where the platform has fewer than six degrees of freedom, else one."""
        targets = ONE if layout.freedoms >= 6 else THREE
        sockets = tuple(f"S{i + 1}" for i in range(len(CORNERS)))
        shares = [[0.35 * share for share in corner] for corner in CORNERS]  # of the half extents
        places = np.array([layout.at(*share) for share in shares]) + 5e-3 * rng.standard_normal((len(CORNERS), 3))
        true = float(np.linalg.norm(places[0] - places[1]))
        distance = round(true + DISTANCE_SIGMA * rng.standard_normal(), 7)
        unknown = drawn_targets("cup", targets, rng)
        for socket, place in zip(sockets, places, strict=True):
            unknown += hidden(f"cup.point[{socket}]", place, np.inf)
        target, which = np.divmod(np.arange(len(stops)) % (len(sockets) * len(targets)), len(sockets))
        sigma = np.full((len(stops), 3), 2e-5)
        return VirtualSocket("cup", stops, tuple(unknown), declared, sigma, targets, sockets, distance, which, target)

    def readings(self, poses: VirtualPoses, u: Floats) -> Floats:
        return np.asarray(self.positions(poses, u, self.target) - self.others(u).reshape(-1, 3)[self.socket])

    def table(self) -> dict[str, Any]:
        return {**super().table(), "distances": [[*self.sockets[:2], self.distance, DISTANCE_SIGMA]]}


TOUCHED: dict[str, Callable[[Layout, Ints, bool, np.random.Generator], Gauge]] = {
    "plane": VirtualPlane.drawn,
    "socket": VirtualSocket.drawn,
}
"""Kinds of touched instruments: the machine moves to them. The others read at any pose."""

ROUNDS = 40
EXACT = 2e-10
"""Largest error of a solved touch, m; deflections are solved to half of it."""
FARTHEST = 0.3
"""Largest change of a command in one step of Newton's method, m or rad."""
SINGULAR = 1e-3
"""Singular values of the readings' derivative by the commands below this share of the largest count as zero."""


Motion = Callable[[Floats], tuple[VirtualPoses, Floats]]
"""At commands q (N, n) of all stops: the TCP's poses (N) as instruments measure them, base frame, NaN out of reach; and their
derivative (N, 6, n) by the commands, position and rotation vector, without effects."""


def motion_of(machine: Moved) -> Motion:
    """The motion of a machine without effects."""

    def motion(q: Floats) -> tuple[VirtualPoses, Floats]:
        poses, by_command = machine.predict(q), np.full((len(q), 6, q.shape[1]), np.nan)
        there = poses.reached
        by_command[there] = machine.command_jacobian(q[there], poses[there])
        return poses, by_command

    return motion


def begun(
    gauge: Gauge, machine: Moved, pool: Floats, ranges: tuple[Floats, Floats], rng: np.random.Generator
) -> Floats:
    """(M, n) commands, m or rad, at which a machine without effects makes the touches of an instrument's rows.

    ``pool``: (P, n) commands all over the workspace; the solution starts from the nearest. ``ranges``: (n,) lower and upper
    ends of the commands.

    Raises UnreachableError if the machine can't make some of the touches.
    """
    # What each row touches, and with which target.
    asked = np.column_stack([getattr(gauge, name) for name in gauge.by_row])
    alike, which = np.unique(asked, axis=0, return_inverse=True)
    found = np.empty((len(gauge.stop), pool.shape[1]))
    there, motion = machine.predict(pool), motion_of(machine)
    lower, upper = ranges
    room = np.where(np.isfinite(upper - lower), 1e-2 * (upper - lower), 0.0)
    for i in range(len(alike)):
        rows = np.flatnonzero(which.ravel() == i)
        misses = np.linalg.norm(gauge.take(np.full(len(pool), rows[0])).readings(there, gauge.truth), axis=1)
        nearest = np.argsort(misses)[: 3 * len(rows)]
        some = replace(gauge.take(np.full(len(nearest), rows[0])), stop=np.arange(len(nearest)))
        solved, good = felt(motion, pool[rng.permutation(nearest)], [some], [np.zeros_like(some.sigma)])
        good &= ((solved >= lower + room) & (solved <= upper - room)).all(axis=1)
        if good.sum() < len(rows):
            hint = "use an instrument that needs no touch, or a robot that can move its target in three directions"
            raise UnreachableError(f"the target does not get to all of {gauge.name}'s {gauge.kind}s", hint=hint)
        found[rows] = solved[good][: len(rows)]
    return found


def felt(motion: Motion, q: Floats, gauges: Sequence[Gauge], errors: Sequence[Floats]) -> tuple[Floats, Mask]:
    """Commands (N, n) near ``q`` that touch with the touched ones of some instruments, and (N,) which of them do; commands of
    other stops are unchanged.

    ``errors``: for each instrument, (M, c) errors of its touches: the readings that are solved for, m.
    """
    touching = [(gauge, error) for gauge, error in zip(gauges, errors, strict=True) if gauge.touches]
    good = np.ones(len(q), dtype=bool)
    for _ in range(ROUNDS if touching else 0):
        (poses, by_command), q, going = motion(q), q.copy(), False
        for gauge, aim in touching:
            here = poses[gauge.stop]
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
    return q, good


def circles(
    nominal: Moved, layout: Layout, pool: Floats, ranges: tuple[Floats, Floats], count: int
) -> tuple[Floats, Floats]:
    """(M, n) commands along circles of the nominal machine, m or rad, and (M, n) their speeds, m/s or rad/s, at 20 mm/s.

    There are at least ``count`` commands, in the order of travel: each circle once in one direction and once in the other. The
    radius is at most 0.3 m, and 0.6 of the half extent of the workspace; shorter ones are tried where this is too long.

    Raises UnreachableError if the robot can't move along any such circles.
    """
    wide = layout.half > 0.1 * layout.half.max()
    planes = [plane for plane in ((0, 1), (0, 2), (1, 2)) if wide[list(plane)].all()]
    points = max(8, -(-count // (2 * max(len(planes), 1))))
    pivot, at_pool = np.array(layout.at(0.0, 0.0, 0.0)), _target(nominal.predict(pool))
    for shorter in (1.0, 0.7, 0.5, 0.35) if planes else ():
        radius = shorter * min(0.3, 0.6 * float(layout.half[wide].min()))
        first, second = (np.array([layout.axes[plane[i]] for plane in planes]) for i in (0, 1))
        # All circles are solved together, each point from the one before, so that an arm keeps its assembly mode.
        q = pool[[int(np.argmin(np.linalg.norm(at_pool - place, axis=1))) for place in pivot + radius * first]]
        ways, speeds = [], []
        for angle in 2.0 * np.pi * np.arange(points) / points:
            brought = _brought(nominal, q, pivot + radius * (np.cos(angle) * first + np.sin(angle) * second))
            if brought is None:
                break
            q, slope = brought
            tangent = np.cos(angle) * second - np.sin(angle) * first
            ways.append(q)
            speeds.append(0.02 * (np.linalg.pinv(slope, rcond=SINGULAR) @ tangent[..., None])[..., 0])
        if len(ways) == points and ((np.array(ways) >= ranges[0]) & (np.array(ways) <= ranges[1])).all():
            there, along = np.stack(ways, axis=1), np.stack(speeds, axis=1)
            both = [np.stack([there, there[:, ::-1]], axis=1), np.stack([along, -along[:, ::-1]], axis=1)]
            return both[0].reshape(-1, pool.shape[1]), both[1].reshape(-1, pool.shape[1])
    hint = "use an instrument that needs no circles, or a robot that moves its target in two directions"
    raise UnreachableError("the robot can't go round a ball bar's circles", hint=hint)


def _brought(nominal: Moved, q: Floats, places: Floats) -> tuple[Floats, Floats] | None:
    """(N, n) commands near ``q`` that bring the target to ``places`` (N, 3), and its derivative (N, 3, n); None: none."""
    for _ in range(30):
        poses, by_command = motion_of(nominal)(q)
        miss, arm = _target(poses) - places, poses.R @ np.array(ONE[""])
        slope = by_command[:, :3] + np.cross(by_command[:, 3:], arm[:, :, None], axis=1)
        if not np.isfinite(miss).all() or not np.isfinite(slope).all():
            return None
        if np.abs(miss).max() < 1e-9:
            return q, slope
        q = q - (np.linalg.pinv(slope, rcond=SINGULAR) @ miss[..., None])[..., 0]
    return None


def _target(poses: VirtualPoses) -> Floats:
    return np.asarray(poses.T + poses.R @ np.array(ONE[""]))
