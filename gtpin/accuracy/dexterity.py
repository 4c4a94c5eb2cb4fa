"""Dexterity: transmission from actuators and rods to the TCP, and distances to singularities and limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.accuracy.rods import reached_poses, rod_kinematics
from gtpin.kinematics.closures import pose_jacobian, rod_vectors
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.model.model import Model
from gtpin.typing import Floats


@dataclass(frozen=True)
class Dexterity:
    """Measures at N poses of a robot with k rods and n actuators.

    Parameters
    ----------
    position_gain
        (N, min(3, n)) singular values, descending, of the derivative of the TCP's position by the commands: m/m, or m/rad for
        actuators that turn.
    rotation_gain
        (N, min(3, n)) singular values of the derivative of the TCP's rotation by the commands: rad/m, or rad/rad.
    condition
        (N,) largest of ``position_gain`` divided by the smallest.
    position_amplification
        (N,) largest displacement of the TCP by rod length errors of unit root sum of squares, m/m.
    rotation_amplification
        (N,) the same for the rotation of the TCP, rad/m.
    singularity
        (N,) smallest singular value of the closures' Jacobian, divided by that at home: 0 at a singularity. A row of the
        Jacobian is the rod's unit vector u and (r x u) / l, with r the vector from the mean of the joints on the platform to
        the rod's joint, and l the root mean square length of all r.
    limit
        (N,) distance of the nearest actuator from the end of its range, m or rad; negative beyond it.
    """

    position_gain: Floats
    rotation_gain: Floats
    condition: Floats
    position_amplification: Floats
    rotation_amplification: Floats
    singularity: Floats
    limit: Floats


def dexterity(model: Model, q: Floats, poses: Poses | None = None) -> Dexterity:
    """The dexterity at commands q (N, n).

    Parameters
    ----------
    poses
        (N) the poses there, base frame, where they are known.

    Raises
    ------
    ModelError
        If the robot has no rods.
    UnreachableError
        If the commands can't be reached.
    """
    kinematics = rod_kinematics(model)
    poses = reached_poses(kinematics, q) if poses is None else poses
    J = kinematics.command_jacobian(q, poses)
    gain = _singular_values(J[:, :3])
    by_rods = np.linalg.inv(unit_rows(kinematics, q, poses))
    home_q = model.robot.home_q[None]
    robot = model.robot
    with np.errstate(divide="ignore"):
        condition = gain[:, 0] / gain[:, -1]
    return Dexterity(
        position_gain=gain,
        rotation_gain=_singular_values(J[:, 3:]),
        condition=condition,
        position_amplification=np.linalg.norm(by_rods[:, :3], ord=2, axis=(1, 2)),
        rotation_amplification=np.linalg.norm(by_rods[:, 3:], ord=2, axis=(1, 2)),
        singularity=_smallest(kinematics, q, poses) / _smallest(kinematics, home_q, kinematics.home),
        limit=np.minimum(q - robot.lower, robot.upper - q).min(axis=1),
    )


def unit_rows(kinematics: RodKinematics, q: Floats, poses: Poses) -> Floats:
    """(N, k, 6) derivative of the rods' lengths \\|d\\| by the TCP's position and rotation vector, base frame."""
    d, RP = rod_vectors(poses, kinematics.ends(q))
    return np.asarray(pose_jacobian(d, RP) / np.linalg.norm(d, axis=2)[..., None])


def _smallest(kinematics: RodKinematics, q: Floats, poses: Poses) -> Floats:
    d, RP = rod_vectors(poses, kinematics.ends(q))
    arm = RP - RP.mean(axis=1, keepdims=True)  # about the joints' mean, so that the result does not depend on the TCP
    size = np.sqrt((arm**2).sum(axis=2).mean(axis=1))
    u = d / np.linalg.norm(d, axis=2)[..., None]
    rows = np.concatenate([u, np.cross(arm, u) / size[:, None, None]], axis=2)
    return np.asarray(_singular_values(rows)[:, -1])


def _singular_values(matrices: Floats) -> Floats:
    return np.asarray(np.linalg.svd(matrices, compute_uv=False), dtype=np.float64)
