"""Dexterity: transmission from actuators and rods to the TCP, and distances to singularities and limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.kinematics.kinematics import Kinematics, reached_poses
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.typing import Floats


@dataclass(frozen=True)
class Dexterity:
    """Measures at N poses of a robot with n actuators.

    - ``position_gain``: (N, min(3, n)) singular values, descending, of the derivative of the TCP's position by the
      commands: m/m, or m/rad for actuators that turn.
    - ``rotation_gain``: (N, min(3, n)) singular values of the derivative of the TCP's rotation by the commands: rad/m, or
      rad/rad.
    - ``condition``: (N,) largest of ``position_gain`` divided by the smallest.
    - ``position_amplification``, ``rotation_amplification``: (N,) largest displacement and rotation of the TCP by rod
      length errors of unit root sum of squares, m/m and rad/m; None for a robot without rods.
    - ``singularity``: (N,) relative distance from a singularity, 0 at one. With rods: the smallest singular value of the
      closures' Jacobian, whose rows are the rod's unit vector u and (r x u) / l, with r the vector from the mean of the
      joints on the platform to the rod's joint, and l the root mean square length of all r. Without rods: that of the
      derivative of the TCP's pose by the commands; rotations are multiplied by the reach, the root mean square distance of
      the TCP from its mean position.
    - ``one_at``: where ``singularity`` is 1: ``home`` with rods; the ``best`` of the N poses without.
    - ``limit``: (N,) distance of the nearest actuator from the end of its range, m or rad; negative beyond it.
    """

    position_gain: Floats
    rotation_gain: Floats
    condition: Floats
    position_amplification: Floats | None
    rotation_amplification: Floats | None
    singularity: Floats
    one_at: str
    limit: Floats

    def measures(self) -> dict[str, Floats]:
        """The measures that this robot has, by name."""
        return {name: values for name, values in vars(self).items() if isinstance(values, np.ndarray)}


def dexterity(model: Model, q: Floats, poses: Poses | None = None) -> Dexterity:
    """The dexterity at commands q (N, n).

    ``poses``: (N) the poses there, base frame, where they are known.

    Raises `UnreachableError` if the commands can't be reached.
    """
    kinematics, robot = model.kinematics, model.robot
    poses = reached_poses(kinematics, q) if poses is None else poses
    J = kinematics.command_jacobian(q, poses)[:, :6]
    gain, rotation_gain = (np.asarray(np.linalg.svd(part, compute_uv=False)) for part in (J[:, :3], J[:, 3:]))
    by_rods = kinematics.motion(q, poses).by_rod_lengths if robot.rod_sites else None
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = gain[:, 0] / gain[:, -1]
    singular, one_at = singularity(kinematics, q, poses)
    return Dexterity(
        position_gain=gain,
        rotation_gain=rotation_gain,
        condition=condition,
        position_amplification=None if by_rods is None else np.linalg.norm(by_rods[:, :3], ord=2, axis=(1, 2)),
        rotation_amplification=None if by_rods is None else np.linalg.norm(by_rods[:, 3:6], ord=2, axis=(1, 2)),
        singularity=singular,
        one_at=one_at,
        limit=np.minimum(q - robot.lower, robot.upper - q).min(axis=1),
    )


def singularity(kinematics: Kinematics, q: Floats, poses: Poses) -> tuple[Floats, str]:
    """(N,) relative distances from a singularity, and where they are 1: see :class:`Dexterity`."""
    if kinematics.robot.rod_sites:
        home_q = kinematics.robot.home_q[None]
        return _by_rods(kinematics, q, poses) / _by_rods(kinematics, home_q, kinematics.home), "home"
    J = kinematics.command_jacobian(q, poses)[:, :6]
    reach = float(np.sqrt(((poses.T - poses.T.mean(axis=0)) ** 2).sum(axis=1).mean()))
    least = np.linalg.svd(np.concatenate([J[:, :3], reach * J[:, 3:]], axis=1), compute_uv=False)[:, -1]
    return np.asarray(least / max(float(least.max()), 1e-300), dtype=np.float64), "best"


def _by_rods(kinematics: Kinematics, q: Floats, poses: Poses) -> Floats:
    """(N,) smallest singular value of the closures' Jacobian of rods."""
    on_platform, on_carriers = kinematics.rod_ends(q, poses)
    d = on_platform - on_carriers
    arm = on_platform - on_platform.mean(axis=1, keepdims=True)
    size = np.sqrt((arm**2).sum(axis=2).mean(axis=1))
    u = d / np.linalg.norm(d, axis=2)[..., None]
    rows = np.concatenate([u, np.cross(arm, u) / size[:, None, None]], axis=2)
    return np.asarray(np.linalg.svd(rows, compute_uv=False), dtype=np.float64)[:, -1]
