"""The kinematics of a robot: in arrays or by Pinocchio if it has rods, by Pinocchio if it has none."""

from __future__ import annotations

from typing import Literal, Protocol

from gtpin.errors import ModelError
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.kinematics.pinocchio_rods import PinocchioRods
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

Solver = Literal["arrays", "pinocchio"]


class Kinematics(Protocol):
    """Kinematics of one geometry for many commands. All poses and derivatives are in the base frame.

    Derivatives have six rows, for the TCP's position (m) and rotation vector (rad), then one row for the coordinate (rad or m)
    of each of the robot's k measured joints (by default k = 0). Poses have these coordinates under ``joints``.
    """

    @property
    def geometry(self) -> Geometry:
        """The geometry of these kinematics."""

    @property
    def home(self) -> Poses:
        """(1) pose at the home commands, base frame."""

    def forward(self, q: Floats, start: Poses | None = None) -> Poses:
        """Poses (N) at commands q (N, n), m or rad; NaN where the loops can't be closed.

        ``start``: poses (N) near the wanted ones, from which the solver starts; None: it finds a start itself.
        """

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6 + k, n) derivative of ``poses``, those at commands q (N, n), by the commands."""

    def geometry_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6 + k, p) derivative of ``poses``, those at commands q (N, n), by the parameters of the geometry."""


def kinematics(geometry: Geometry, solver: Solver = "arrays") -> Kinematics:
    """The kinematics of a geometry.

    Parameters
    ----------
    solver
        For robots with rods. ``arrays``: all poses at once, in NumPy. ``pinocchio``: pose by pose, slower, with the same
        results. For robots without rods Pinocchio is used in both cases.

    Raises
    ------
    ModelError
        If there is no such solver, or the solver ``pinocchio`` can't represent the geometry: see
        :class:`~gtpin.kinematics.pinocchio_rods.PinocchioRods`.
    """
    if solver not in ("arrays", "pinocchio"):
        raise ModelError(f"kinematics {solver!r}", hint="use arrays or pinocchio")
    if not geometry.robot.rods:
        return ChainKinematics(geometry)
    return RodKinematics(geometry) if solver == "arrays" else PinocchioRods(geometry)
