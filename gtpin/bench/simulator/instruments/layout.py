"""Places of instruments relative to a robot: from its workspace, the vertical, and its degrees of freedom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.bench.simulator.instruments.gauge import Place
from gtpin.bench.simulator.poses import Poses, across
from gtpin.typing import Floats

INNER = (5.0, 95.0)
"""Percentiles of the TCP's coordinates that bound the workspace."""
MILLIMETRE = 3
"""Decimals to which places are declared, in m."""


@dataclass(frozen=True, eq=False)
class Layout:
    """The workspace of a robot."""

    centre: Floats  # (3,) its centre, base frame, m
    axes: Floats  # (3, 3) rows: two level directions, and up (against gravity), base frame
    half: Floats  # (3,) half its extent along the axes, m
    freedoms: int  # Number of commands

    @staticmethod
    def of(poses: Poses, gravity: Floats, freedoms: int) -> Layout:
        """The workspace that some poses of the TCP fill."""
        size = float(np.linalg.norm(gravity))
        up = 0.0 - gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
        axes = np.vstack([across(up), up])
        low, high = np.percentile(poses.T @ axes.T, INNER, axis=0)
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
        """A place, base frame, m, at a horizontal distance from the centre, m, in a direction, rad, and at a height above it,
        m."""
        level = np.cos(angle) * self.axes[0] + np.sin(angle) * self.axes[1]
        return _rounded(self.centre + distance * level + height * self.up)


def _rounded(place: Floats) -> Place:
    x, y, z = (float(value) for value in np.round(place, MILLIMETRE) + 0.0)
    return x, y, z
