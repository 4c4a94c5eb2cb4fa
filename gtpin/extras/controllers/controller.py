"""A controller: how it computes commands from positions, and the box of positions in which its correction tables are valid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gtpin.compensation.machine import CompensatedMachine
from gtpin.errors import GtpinError, UnreachableError
from gtpin.kinematics.first_guess import halton
from gtpin.kinematics.inverse import commands_for
from gtpin.model.model import Model
from gtpin.typing import Floats

LARGEST = 10.0
"""Coordinate, m, above which a box looks like one in millimetres. Assumed."""
STEPS = 4
"""Steps of the iteration; each multiplies the distance from the wanted position by the relative error of the controller's
geometry, about 0.001."""


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


Controller = Callable[[Floats], Floats]
"""The kinematics of a controller: (N, n) commands, m or rad, for positions (N, 3) in its coordinates, m; NaN out of reach."""


def controller_of(model: Model, origin: Floats) -> Controller:
    """A controller with the kinematics of a model, without effects; ``origin``: (3,) its zero in the base frame, m."""

    def commands(xyz: Floats) -> Floats:
        return commands_for(model.kinematics, xyz + origin)[0]

    return commands


def positions_to_ask_for(machine: CompensatedMachine, controller: Controller, box: Box, wanted: Floats) -> Floats:
    """(N, 3) positions to command so that the machine's TCP reaches ``wanted`` (N, 3), controller's coordinates, m.

    Raises `UnreachableError` if the machine can't bring its TCP to one of them.
    """
    asked = wanted.copy()
    for _ in range(STEPS):
        asked = asked + wanted - there(machine, controller, box, asked)
    return asked


def there(
    machine: CompensatedMachine, controller: Controller, box: Box, asked: Floats, approach: Floats | None = None
) -> Floats:
    """(N, 3) positions that the machine's TCP reaches for commanded positions ``asked`` (N, 3), controller's coordinates, m.

    ``approach``: (N,) direction, +1 or -1, from which all actuators come to each position; None: the mean of both.

    Raises `UnreachableError` if the machine can't bring its TCP to one of them.
    """
    q = controller(asked)
    inside = np.isfinite(q).all(axis=1)
    found = np.full_like(asked, np.nan)
    found[inside] = machine.goes_to(q[inside], None if approach is None else approach[inside])
    lost = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if lost.size:
        where = ", ".join(f"{value:.4g}" for value in asked[lost[0]])
        raise UnreachableError(
            f"{machine.model.robot.name} can't bring its TCP to ({where}) of the controller",
            hint="give a smaller --box, and the --origin of the controller's coordinates",
        )
    return found - box.origin
