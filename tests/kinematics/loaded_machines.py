"""Machines as gtpin has them: loaded, and with geometries drawn from their tolerances."""

from collections.abc import Callable

import numpy as np
from closures import Closures
from urdfs import crossing

import gtpin
from gtpin.robot.description import RobotDescription

Floats = np.ndarray


def load(machine: Closures) -> gtpin.Robot:
    return gtpin.Robot(RobotDescription.parse(machine.urdf, machine.name))


def drawn(robot: gtpin.Robot, seed: int, **options: str) -> gtpin.Geometry:
    """A geometry drawn from a robot's tolerances."""
    nominal = gtpin.Geometry.nominal(robot, **options)  # type: ignore[arg-type]
    rng = np.random.default_rng(seed)
    return nominal.with_values(nominal.values + nominal.tolerance * rng.standard_normal(len(nominal.values)))


def differences(poses: Callable[[Floats], gtpin.Poses], x: Floats, step: float) -> Floats:
    """Central differences, of fourth order, of N poses by x (p,): (N, 6, p)."""
    columns = []
    for k in range(len(x)):
        h = np.zeros(len(x))
        h[k] = step
        once, twice = (poses(x + f * h).minus(poses(x - f * h)) / (2.0 * f * step) for f in (1.0, 2.0))
        columns.append((4.0 * once - twice) / 3.0)
    return np.stack(columns, axis=2)


def closed_by_hand(q: float, side: float) -> dict[str, tuple[Floats, float]]:
    """Origins (2,) and directions, rad, of the four-bar's links, by where two circles meet; side is +1 or -1."""
    crank, base = 0.2 * np.array([np.cos(q), np.sin(q)]), np.array([0.6, 0.0])
    pin = crossing(crank, 0.5, base, 0.45, side)
    return {name: (at, float(np.arctan2(*(pin - at)[::-1]))) for name, at in (("coupler", crank), ("rocker", base))}
