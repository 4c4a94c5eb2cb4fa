"""Tracks that were measured along the guideways: piecewise linear between the measured points, undefined outside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.errors import ModelError
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class MeasuredTrack:
    """The path of a cart, interpolated between measured points (Dressler et al. 2010, eq. 4).

    - ``q``: (K,) ascending commands, m, of the measured points.
    - ``path``: (K, 3) displacement of the cart's measured point from its position at the command 0, m. Its frame is
      parallel to the base frame as far as the measurement of the track determines that; a calibration identifies the
      remaining rotation.
    - ``turns``: (K, 3) rotation vectors of the cart from its orientation at the command 0, rad, in the same frame; None
      where only positions are used.
    - ``origin``: (3,) approximate position of the measured point at the command 0, base frame, m. The cart rotates about
      this point.
    """

    q: Floats
    path: Floats
    turns: Floats | None
    origin: Floats

    def __post_init__(self) -> None:
        for name in ("q", "path", "turns", "origin"):
            value = getattr(self, name)
            if value is not None:
                frozen = np.array(value, dtype=float)
                frozen.flags.writeable = False
                object.__setattr__(self, name, frozen)
        if len(self.q) < 2 or not (np.diff(self.q) > 0.0).all():
            raise ModelError("a measured track needs two or more different commands", hint="measure more points")

    @property
    def lower(self) -> float:
        """Smallest command at which the track was measured, m."""
        return float(self.q[0])

    @property
    def upper(self) -> float:
        """Largest command at which the track was measured, m."""
        return float(self.q[-1])

    def displacement(self, q: Floats) -> Floats:
        """(N, 3) path at commands (N,), m; NaN outside the measured range."""
        return self._interpolated(self.path, q)

    def slope(self, q: Floats) -> Floats:
        """(N, 3) derivative of the path by the command; at a measured point, that of the piece towards larger commands."""
        return self._slope(self.path, q)

    def turn(self, q: Floats) -> Floats:
        """(N, 3) rotation vectors of the cart, rad; zero where orientations are not used."""
        return np.zeros((len(q), 3)) if self.turns is None else self._interpolated(self.turns, q)

    def turn_slope(self, q: Floats) -> Floats:
        """(N, 3) derivative of the rotation vectors by the command, rad/m."""
        return np.zeros((len(q), 3)) if self.turns is None else self._slope(self.turns, q)

    def _interpolated(self, values: Floats, q: Floats) -> Floats:
        columns = [np.interp(q, self.q, column, left=np.nan, right=np.nan) for column in values.T]
        return np.stack(columns, axis=1)

    def _slope(self, values: Floats, q: Floats) -> Floats:
        piece = np.clip(np.searchsorted(self.q, q, side="right") - 1, 0, len(self.q) - 2)
        return np.asarray((np.diff(values, axis=0) / np.diff(self.q)[:, None])[piece])
