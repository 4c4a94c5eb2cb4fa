"""View direction of a drawing: the one in which the rods hide each other least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.report.skeleton import BARE, Skeleton
from gtpin.typing import Floats

WIDTH, HEIGHT, MARGIN = 560.0, 400.0, 46.0
"""Size of a sketch, pixels."""
ELEVATION = np.deg2rad(24.0)


@dataclass(frozen=True)
class Camera:
    """Projects points in space to pixels, x to the right and y down."""

    axes: Floats
    centre: Floats
    scale: float

    @staticmethod
    def of(machine: Skeleton, beyond: Floats | None = None) -> Camera:
        """A camera a little above the machine, in the direction in which its lines hide each other least.

        ``beyond``: (m, 3) further points that must be in the picture, m.
        """
        best = max(
            (_axes(machine.up, a) for a in np.deg2rad(np.arange(0.0, 360.0, 10.0))), key=lambda v: _open(machine, v)
        )
        flat = (machine.points if beyond is None else np.vstack([machine.points, beyond])) @ best.T
        size = np.ptp(flat, axis=0)
        room = np.array([WIDTH - 2.0 * MARGIN, HEIGHT - 2.0 * MARGIN])
        return Camera(best, (flat.max(axis=0) + flat.min(axis=0)) / 2.0, float((room / np.maximum(size, 1e-9)).min()))

    def __call__(self, points: Floats) -> Floats:
        """(m, 2) pixels of points (m, 3)."""
        flat = (np.atleast_2d(points) @ self.axes.T - self.centre) * self.scale
        return np.asarray(flat * [1.0, -1.0] + [WIDTH / 2.0, HEIGHT / 2.0])


def _axes(up: Floats, azimuth: float) -> Floats:
    """(2, 3) unit vectors to the right and upwards in a picture, for an azimuth about the vertical, rad."""
    side = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    side /= np.linalg.norm(side)
    right = np.cos(azimuth) * side + np.sin(azimuth) * np.cross(up, side)
    into = np.cross(up, right)
    return np.array([right, np.cos(ELEVATION) * up + np.sin(ELEVATION) * into])


def _open(machine: Skeleton, axes: Floats) -> float:
    """Score of a view: larger where the lines' ends and middles are farther apart in the picture, and it is less flat."""
    lines = np.array([line.ends for line in machine.of(*BARE)]) @ axes.T
    flat = np.vstack([lines[:, 0], lines.mean(axis=1)])
    apart = np.linalg.norm(flat[:, None] - flat[None, :], axis=2)[np.triu_indices(len(flat), 1)]
    size = np.ptp(machine.points @ axes.T, axis=0)
    return float(np.log(apart / np.linalg.norm(size) + 0.01).mean() + np.log(size.min() / size.max() + 0.1))
