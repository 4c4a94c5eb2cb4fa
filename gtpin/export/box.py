"""A box of positions in a controller's coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gtpin.errors import GtpinError
from gtpin.kinematics.first_guess import halton
from gtpin.typing import Floats

LARGEST = 10.0
"""Coordinate, m, above which a box looks like one in millimetres. Assumed."""


@dataclass(frozen=True, eq=False)
class Box:
    """A box in the coordinates of a controller, whose axes are parallel to those of the base frame.

    ``low``, ``high``: (3,) corners, m. ``origin``: (3,) the controller's zero in the base frame, m.
    """

    low: Floats
    high: Floats
    origin: Floats

    @staticmethod
    def of(ends: Sequence[float], origin: Sequence[float] = (0.0, 0.0, 0.0)) -> Box:
        """The box with the ends x0, x1, y0, y1, z0, z1, m.

        Raises `GtpinError` if a number is not finite or looks like millimetres, or x1, y1 or z1 is not larger than x0, y0 or
        z0.
        """
        sides, zero = np.array(ends, dtype=float), np.array(origin, dtype=float)
        low, high = sides[::2], sides[1::2]
        if not (len(sides) == 6 and np.isfinite([*sides, *zero]).all() and (high > low).all()):
            raise GtpinError("this is no box", column="box", hint="give x0 x1 y0 y1 z0 z1, m, the smaller one first")
        if np.abs(sides).max() > LARGEST:
            what = f"a box that ends at {np.abs(sides).max():g} m looks like millimetres"
            raise GtpinError(what, column="box", hint="give x0 x1 y0 y1 z0 z1 in m")
        return Box(low, high, zero)

    def grid(self, x: int, y: int, z: int) -> Floats:
        """(x * y * z, 3) nodes of a regular grid with x, y and z nodes along the axes, m; x varies fastest, then y."""
        axes = [np.linspace(a, b, n) for a, b, n in zip(self.low, self.high, (x, y, z), strict=True)]
        up, across, along = np.meshgrid(*axes[::-1], indexing="ij")
        return np.column_stack([along.ravel(), across.ravel(), up.ravel()])

    def fill(self, count: int) -> Floats:
        """(count, 3) points, m, that fill the box evenly without lying on a grid."""
        return spread(self.low, self.high, count)


def spread(low: Floats, high: Floats, count: int) -> Floats:
    """(count, n) points of Halton's sequence between (n,) corners, without the first, which is a corner."""
    return np.asarray(low + (high - low) * halton(len(low), count + 1)[1:])
