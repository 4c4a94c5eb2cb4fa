"""Stiffness of the TCP from compliant rods and drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.accuracy.sensitivity import rod_names
from gtpin.errors import ModelError
from gtpin.kinematics.kinematics import reached_poses
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.typing import Floats


@dataclass(frozen=True)
class Stiffness:
    """Stiffness at N poses, at the TCP, in the axes of the base frame.

    ``matrix``: (N, 6, 6) force, N, and moment, N m, by displacement, m, and rotation vector, rad. ``principal``: (N, 3)
    stiffness for a force at the TCP along the three principal directions, ascending, N/m (1 N/um = 1e6 N/m): eigenvalues of
    the inverse of the compliance's position block. The platform is free to rotate. ``directions``: (N, 3, 3) these
    directions, one per column.
    """

    matrix: Floats
    principal: Floats
    directions: Floats


def stiffness(
    model: Model, q: Floats, rod: float | Floats, drive: float | Floats = np.inf, poses: Poses | None = None
) -> Stiffness:
    """K = J' (1 / k_rod + B (1 / k_drive) B')^-1 J at commands q (N, n), unloaded.

    J is the derivative of the distances between the rods' joints by the TCP's pose, B that by the commands. A rod and its drive
    are springs in series, and rods on one cart share the drive.

    ``rod``: stiffness along a rod with its joints, N/m: one number, or (k,). ``drive``: stiffness of an actuator along its
    command, N/m, or N m/rad where it turns: one number, or (n,); infinite for a rigid drive. ``poses``: (N) the poses
    there, base frame, where they are known.

    Raises `ModelError` if a stiffness is not positive or the robot has no rods. `UnreachableError` if the commands can't be
    reached.
    """
    kinematics, count = model.kinematics, len(rod_names(model))
    rods, drives = (np.asarray(k, dtype=float) for k in (rod, drive))
    shapes = ((rods, count), (drives, model.robot.n_actuators))
    if any(not (k > 0.0).all() or k.shape not in ((), (size,)) for k, size in shapes):
        raise ModelError(
            "a stiffness that is none", hint="give one positive number in N/m, or one for each rod or actuator"
        )
    poses = reached_poses(kinematics, q) if poses is None else poses
    on_platform, on_carriers = kinematics.rod_ends(q, poses)
    u = on_platform - on_carriers
    u = u / np.linalg.norm(u, axis=2)[..., None]
    J = np.concatenate([u, np.cross(on_platform - poses.T[:, None], u)], axis=2)
    B = -J @ kinematics.command_jacobian(q, poses)
    give = (B / np.broadcast_to(drives, B.shape[-1:])) @ np.swapaxes(B, 1, 2)
    give = give + np.diag(np.broadcast_to(1.0 / rods, count))
    matrix = np.swapaxes(J, 1, 2) @ np.linalg.solve(give, J)
    compliance = np.linalg.inv(J)
    compliance = compliance @ give @ np.swapaxes(compliance, 1, 2)
    values, directions = np.linalg.eigh(compliance[:, :3, :3])
    return Stiffness(matrix, 1.0 / values[:, ::-1], directions[:, :, ::-1])
