"""Instruments that are touched: planes, and sockets for a ball. The machine moves to where the reading is zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gtpin.bench.simulator.instruments.gauge import ONE, THREE, Hidden, Place, Targeted, drawn_targets, hidden
from gtpin.bench.simulator.instruments.layout import Layout
from gtpin.bench.simulator.poses import Poses, across, exp
from gtpin.typing import Floats, Ints

HEIGHT_SIGMA, NORMAL_SIGMA = 5e-3, 5e-3
"""Standard deviations of planes' errors, m and rad: the prior sigmas that a dataset has by default."""
APART, TILTED = 0.5, 0.35
"""Heights of the level planes, in half heights of the workspace, and the tilt of the third, rad."""
SPREAD = 0.35
"""Distance of the sockets from the centre along each axis, in half extents of the workspace."""
CORNERS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
"""Directions of the sockets from the centre, by axis of the layout."""
PLACED = 5e-3
"""Standard deviation of the sockets' positions about these corners, per axis, m."""
DISTANCE_SIGMA = 5e-5
"""Standard deviation of the known distance between two sockets, m."""


@dataclass(frozen=True, eq=False)
class Plane(Targeted):
    """z = n . (p - point) - height, with target p, and the plane's normal n and a point of it."""

    kind: ClassVar[str] = "plane"
    touches: ClassVar[bool] = True
    by_row: ClassVar[dict[str, str]] = {"plane": "planes"}
    noise = (1e-5, 1)  # repeatability of a touch probe

    planes: dict[str, tuple[Place, Floats]]  # The declared planes by id: a point, m, and a unit normal, base frame
    plane: Ints  # (M,) index of each row's plane

    @staticmethod
    def drawn(layout: Layout, stops: Ints, declared: bool, rng: np.random.Generator) -> Plane:
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
        unknown = (*drawn_targets("bed", ONE, rng), *off)
        return Plane("bed", stops, unknown, declared, ONE, planes, np.arange(len(stops)) % len(planes))

    def readings(self, poses: Poses, u: Floats) -> Floats:
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
class Socket(Targeted):
    """z = p - s, with target p and socket s, m."""

    kind: ClassVar[str] = "socket"
    touches: ClassVar[bool] = True
    by_row: ClassVar[dict[str, str]] = {"socket": "sockets", "target": "targets"}
    noise = (2e-5, 3)  # repeatability of a ball in its socket, per axis

    sockets: tuple[str, ...]  # Ids of the sockets; their positions are unknown to the user
    distance: float  # Declared distance between the first two sockets, m
    # `socket`, `target`: (M,) indices of each row's socket and target
    socket: Ints
    target: Ints

    @staticmethod
    def drawn(layout: Layout, stops: Ints, declared: bool, rng: np.random.Generator) -> Socket:
        """Four sockets in the workspace; three targets where the platform has fewer than six degrees of freedom, else one."""
        targets = ONE if layout.freedoms >= 6 else THREE
        sockets = tuple(f"S{i + 1}" for i in range(len(CORNERS)))
        shares = [[SPREAD * share for share in corner] for corner in CORNERS]
        places = np.array([layout.at(*share) for share in shares]) + PLACED * rng.standard_normal((len(CORNERS), 3))
        true = float(np.linalg.norm(places[0] - places[1]))
        distance = round(true + DISTANCE_SIGMA * rng.standard_normal(), 7)
        unknown = drawn_targets("cup", targets, rng)
        for socket, place in zip(sockets, places, strict=True):
            unknown += hidden(f"cup.point[{socket}]", place, np.inf)
        which, target = np.divmod(np.arange(len(stops)) % (len(sockets) * len(targets)), len(sockets))[::-1]
        return Socket("cup", stops, tuple(unknown), declared, targets, sockets, distance, which, target)

    def readings(self, poses: Poses, u: Floats) -> Floats:
        return np.asarray(self.positions(poses, u, self.target) - self.others(u).reshape(-1, 3)[self.socket])

    def table(self) -> dict[str, Any]:
        return {**super().table(), "distances": [[*self.sockets[:2], self.distance, DISTANCE_SIGMA]]}
