"""Where an effect's displacements put the rods' joints on their carriers, by nothing but the places of frames."""

import numpy as np
import pinocchio as pin

from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import OperatingPoints
from gtpin.robot.placement_frames import frame_of_joint

Floats = np.ndarray


def rates(at: OperatingPoints, found: Displacement) -> Floats:
    """(N, k, 3, m) motion of the joints, base frame, m, per unit of each of m coefficients."""
    n, k = len(at), len(at.robot.rods)
    moved = np.zeros((n, k, 3, len(found))) if found.carrier_joints is None else found.carrier_joints.copy()
    for i, (index, twist) in ((i, own) for own in found.placements for i in _on(at, own[0])):
        R, T = at.bodies.frame(index)
        lever = (at.carrier_joints[:, i] - T)[:, :, None]
        moved[:, i] += R @ twist[:, :3] + np.cross(R @ twist[:, 3:], lever, axis=1)
    return moved


def displaced(at: OperatingPoints, found: Displacement, coefficients: Floats) -> Floats:
    """(N, k, 3) finite displacements of the joints, base frame, m: frames move by the exponentials of their twists."""
    n, k = len(at), len(at.robot.rods)
    moved = np.zeros((n, k, 3)) if found.carrier_joints is None else found.carrier_joints @ coefficients
    for index, columns in found.placements:
        R, T = at.bodies.frame(index)
        for row, twist in enumerate(columns @ coefficients):
            by = pin.exp6(twist)
            for i in _on(at, index):
                lever = R[row].T @ (at.carrier_joints[row, i] - T[row])
                moved[row, i] += R[row] @ (by.act(lever) - lever)
    return moved


def _on(at: OperatingPoints, index: int) -> list[int]:
    """The rods on what an actuator carries whose joint has the placement frame ``index``."""
    actuators = at.robot.actuators
    carriers = [None if rod.carrier is None else actuators[rod.carrier].joint_id for rod in at.robot.rods]
    return [i for i, joint in enumerate(carriers) if joint is not None and frame_of_joint(joint) == index]
