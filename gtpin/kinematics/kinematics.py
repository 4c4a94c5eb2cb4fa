"""The kinematics of a robot: in arrays if it has rods, by Pinocchio if it has none."""

from __future__ import annotations

import numpy as np

from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture
from gtpin.kinematics.protocol import Kinematics
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

__all__ = ["Kinematics", "geometry_jacobian", "kinematics", "of_rods", "reached_poses"]


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


def reached_poses(kinematics: Kinematics, q: Floats) -> Poses:
    """Poses (N), base frame, at commands q (N, n).

    Raises `ModelError` if there are no commands, or they do not have that shape. `UnreachableError` if one can't be
    reached; the message names its row, counted from 0.
    """
    poses = kinematics.forward(q)
    if not len(poses):
        raise ModelError("no commands", hint="give at least one")
    lost = np.flatnonzero(~poses.reached)
    if lost.size:
        name = kinematics.geometry.robot.name
        raise UnreachableError(f"{name} can't reach the commands in row {lost[0]}", hint="leave them out")
    return poses


def geometry_jacobian(posture: ClosedPosture, geometry: Geometry) -> Floats:
    """(6, p) derivative of the TCP's pose by geometric parameters: position (m) and rotation vector (rad), base frame.

    Parameters
    ----------
    posture
        A posture of the robot whose URDF has this geometry.
    geometry
        Its p parameters. For a robot with rods their values must be nominal.

    Raises
    ------
    ModelError
        If the geometry is not that of the posture's robot, or has shared rod lengths or measured tracks, which a URDF can't
        have.

    Examples
    --------
    >>> import gtpin
    >>> robot = gtpin.load_robot("gantry_tau")
    >>> gtpin.geometry_jacobian(gtpin.home(robot), gtpin.Geometry.nominal(robot)).shape
    (6, 48)
    """
    robot = posture.robot
    if robot.description.xml != geometry.robot.description.xml or robot.tcp_frame != geometry.robot.tcp_frame:
        raise ModelError("the geometry is another robot's", hint="load both from one URDF")
    if robot.rods and np.any(geometry.deviation != 0.0):
        raise ModelError("the posture is not of this geometry", hint="load the calibrated URDF and move its home there")
    if geometry.reduced or any(track is not None for track in geometry.tracks):
        raise ModelError(
            "shared rods and measured tracks are not in the URDF", hint="use RodKinematics.geometry_jacobian"
        )
    pose = Poses(posture.T[None], posture.R[None])
    jacobian = kinematics(geometry).geometry_jacobian(posture.q[None], pose)[0, :6]
    jacobian.flags.writeable = False
    return jacobian
