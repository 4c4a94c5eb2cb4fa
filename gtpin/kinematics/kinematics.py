"""The kinematics of a robot: in arrays or by Pinocchio if it has rods, by Pinocchio if it has none."""

from __future__ import annotations

from typing import Literal

from gtpin.errors import ModelError
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.kinematics.pinocchio_rods import PinocchioRods
from gtpin.kinematics.protocol import Kinematics
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.robot.geometry import Geometry

__all__ = ["Kinematics", "Solver", "kinematics", "of_rods"]

Solver = Literal["arrays", "pinocchio"]


def kinematics(geometry: Geometry, solver: Solver = "arrays") -> Kinematics:
    """The kinematics of a geometry.

    ``solver``: for robots with rods. ``arrays``: all poses at once, in NumPy. ``pinocchio``: pose by pose, slower, with the
    same results. For robots without rods Pinocchio is used in both cases.

    Raises `ModelError` if there is no such solver, or the solver ``pinocchio`` can't represent the geometry: see
    :class:`~gtpin.kinematics.pinocchio_rods.PinocchioRods`.
    """
    if solver not in ("arrays", "pinocchio"):
        raise ModelError(f"kinematics {solver!r}", hint="use arrays or pinocchio")
    if not geometry.robot.rods:
        return ChainKinematics(geometry)
    return RodKinematics(geometry) if solver == "arrays" else PinocchioRods(geometry)


def of_rods(kinematics: Kinematics) -> RodKinematics:
    """The closures in arrays of a robot with rods.

    Raises `ModelError` if the robot has no rods.
    """
    if not isinstance(kinematics, RodKinematics):
        name = kinematics.geometry.robot.name
        raise ModelError(f"{name} has no rods", hint="this analysis is of rods that hold a platform")
    return kinematics
