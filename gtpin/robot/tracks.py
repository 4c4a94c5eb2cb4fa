"""Tracks as they were measured along the guideways: piecewise linear, valid where they were measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.errors import ModelError

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeasuredTrack:
    """The path of a cart, interpolated between measured points (Dressler et al. 2010, eq. 4).

    Parameters
    ----------
    q
        (K,) ascending commands, m, of the measured points.
    path
        (K, 3) where the measured point of the cart was, less where it was at zero, m, in a frame turned like the base
        frame as well as the measurement itself can tell; a calibration turns it the rest.
    turns
        (K, 3) rotation vectors of the cart since zero, rad, in the same frame; None where only positions are used.
    origin
        (3,) where the measured point was at zero, base frame, m, roughly: what the cart turns about.
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
        """(N, 3) derivative of the path by the command; at a measured point that of the piece above it."""
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
