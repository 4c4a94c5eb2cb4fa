"""Machines as gtpin has them: loaded, and with geometries drawn from their tolerances."""

import numpy as np
from machines import Machine

import gtpin
from gtpin.robot.description import RobotDescription


def load(machine: Machine) -> gtpin.Robot:
    return gtpin.Robot(RobotDescription.parse(machine.urdf, machine.name))


def drawn(robot: gtpin.Robot, seed: int, **options: str) -> gtpin.Geometry:
    """A geometry drawn from a robot's tolerances."""
    nominal = gtpin.Geometry.nominal(robot, **options)  # type: ignore[arg-type]
    rng = np.random.default_rng(seed)
    return nominal.with_values(nominal.values + nominal.tolerance * rng.standard_normal(len(nominal.values)))
