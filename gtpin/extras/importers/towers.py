"""The dimensions of a linear delta, as printers' firmwares have them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gtpin.typing import Floats

ANGLES = (210.0, 330.0, 90.0)
"""Usual angles of the towers about the middle of the bed, from the x axis, degrees: Klipper's defaults; RepRapFirmware's angles
are corrections to them."""


@dataclass(frozen=True, eq=False)
class Towers:
    """The dimensions of a linear delta, m and rad; RepRapFirmware's towers X, Y, Z are a, b, c.

    - ``radius``: distance from the middle axis to each tower, less the radius of the effector.
    - ``arms``, ``angles``: (3,) length of the arms; direction of each tower from the middle axis, angle from the x axis.
    - ``ends``: (3,) height of the nozzle above z = 0, if it is on the middle axis and this tower's carriage is at its end
      stop.
    - ``scale``: (3,) travel per motor step divided by the configured travel per step.
    """

    radius: float
    arms: Floats
    angles: Floats
    ends: Floats
    scale: Floats

    @staticmethod
    def in_file(radius: float, arms: ArrayLike, angles: ArrayLike, ends: ArrayLike) -> Towers:
        """The dimensions of a firmware's file, mm and degrees, with scale 1."""
        return Towers(1e-3 * radius, 1e-3 * np.asarray(arms), np.radians(angles), 1e-3 * np.asarray(ends), np.ones(3))

    def heights(self, xyz: Floats) -> Floats:
        """(N, 3) heights of the carriages above z = 0 for nozzles at (N, 3), m; NaN for positions out of reach of an arm."""
        across = ((xyz[:, None, :2] - self.feet) ** 2).sum(axis=2)
        with np.errstate(invalid="ignore"):
            return np.asarray(xyz[:, 2:] + np.sqrt(self.arms**2 - across))

    @property
    def feet(self) -> Floats:
        """(3, 2) x and y of the towers, m."""
        return self.radius * np.column_stack([np.cos(self.angles), np.sin(self.angles)])

    @property
    def tops(self) -> Floats:
        """(3,) heights of the carriages above z = 0 at their end stops, m."""
        return np.asarray(self.ends + np.sqrt(self.arms**2 - self.radius**2))

    @property
    def values(self) -> Floats:
        """(13,) radius, arms, angles, ends and scale in one vector."""
        return np.concatenate([[self.radius], self.arms, self.angles, self.ends, self.scale])

    @staticmethod
    def of(values: Floats) -> Towers:
        """The dimensions from a vector as :attr:`values` has it."""
        return Towers(float(values[0]), *np.split(values[1:], 4))
