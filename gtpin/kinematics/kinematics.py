"""The kinematics of a robot: in arrays if it has rods, by Pinocchio if it has none."""

from __future__ import annotations

from gtpin.errors import ModelError
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.kinematics.protocol import Kinematics
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.robot.geometry import Geometry

__all__ = ["Kinematics", "kinematics", "of_rods"]


def kinematics(geometry: Geometry) -> Kinematics:
    """The kinematics of a geometry: of rods all poses at once, in NumPy."""
    return RodKinematics(geometry) if geometry.robot.rods else ChainKinematics(geometry)


def of_rods(kinematics: Kinematics) -> RodKinematics:
    """The closures in arrays of a robot with rods.

    Raises `ModelError` if the robot has no rods.
    """
    if not isinstance(kinematics, RodKinematics):
        name = kinematics.geometry.robot.name
        raise ModelError(f"{name} has no rods", hint="this analysis is of rods that hold a platform")
    return kinematics
