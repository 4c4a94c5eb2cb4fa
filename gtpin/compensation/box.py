"""The part of the workspace that tables of a controller are made for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.errors import GtpinError

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Box:
    """A box in the coordinates of a controller, whose axes are parallel to those of the base frame.

    Parameters
    ----------
    low, high
        (3,) corners, m.
    origin
        (3,) the controller's zero in the base frame, m.
    """

    low: Floats
    high: Floats
    origin: Floats

    @staticmethod
    def of(ends: Sequence[float], origin: Sequence[float] = (0.0, 0.0, 0.0)) -> Box:
        """The box with the ends x0, x1, y0, y1, z0, z1, m.

        Raises
        ------
        GtpinError
            If an end is not finite, or not above the other one.
        """
        low, high = np.array(ends, dtype=float).reshape(3, 2).T
        zero = np.array(origin, dtype=float)
        if not (np.isfinite(np.concatenate([low, high, zero])).all() and (high > low).all()):
            raise GtpinError("this is no box", column="box", hint="give x0 x1 y0 y1 z0 z1, m, the smaller one first")
        return Box(low, high, zero)

    def grid(self, x: int, y: int, z: int) -> Floats:
        """(x y z, 3) points, x fastest, then y."""
        axes = [np.linspace(a, b, n) for a, b, n in zip(self.low, self.high, (x, y, z), strict=True)]
        up, across, along = np.meshgrid(*axes[::-1], indexing="ij")
        return np.column_stack([along.ravel(), across.ravel(), up.ravel()])

    def fill(self, count: int) -> Floats:
        """(count, 3) points that fill the box and are those of no grid: Halton's sequence."""
        from scipy.stats import qmc

        return np.asarray(self.low + (self.high - self.low) * qmc.Halton(3, scramble=False).random(count + 1)[1:])
