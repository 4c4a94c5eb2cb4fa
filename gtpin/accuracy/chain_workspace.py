"""Robots without rods: the reachable positions of the TCP, from many postures, and the robot's dexterity there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median

from gtpin.errors import UnreachableError
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.typing import Floats, Mask

POSTURES = 8192
"""Number of postures of a map, reached or not: 8,192 over 5 * 17 * 17 cells are about six for each cell."""
COUNTS = (5, 17)
"""Numbers of cells of a map along its thinnest direction, and along the other two."""
ENDLESS = 2048
"""Number of them for a robot with loops and drives without limits: many of its commands are far, or can't be reached."""
CONDITIONED = 10.0
"""Largest motion of the TCP by unit commands, relative to that at home, of a robot with loops: nearer to a singularity, a small
error of the geometry can open the loops."""
FLAT = 1e-6
"""Extent, m, below which a workspace counts as flat in a direction."""


@dataclass(frozen=True)
class ChainDexterity:
    """Measures at N poses of a robot with n actuators.

    Parameters
    ----------
    position_gain
        (N, min(3, n)) singular values, descending, of the derivative of the TCP's position by the commands: m/rad, or m/m for a
        prismatic joint.
    rotation_gain
        (N, min(3, n)) singular values of the derivative of the TCP's rotation by the commands: rad/rad, or rad/m for a
        prismatic joint.
    condition
        (N,) largest of ``position_gain`` divided by the smallest.
    singularity
        (N,) smallest singular value of the derivative of the TCP's pose by the commands, divided by the largest of these values
        over the N poses: 0 at a singularity. Rotations are multiplied by the reach, the root mean square distance of the TCP
        from its mean position.
    limit
        (N,) distance of the nearest actuator from the end of its range, m or rad; negative beyond it.
    """

    position_gain: Floats
    rotation_gain: Floats
    condition: Floats
    singularity: Floats
    limit: Floats


@dataclass(frozen=True)
class ChainWorkspace:
    """A box of cells, and postures with the cells of their TCPs.

    Parameters
    ----------
    axes
        Coordinates, m, of the cells' middles along x, y and z of the base frame; nx, ny and nz of them.
    across
        Index of the axis along which the workspace is thinnest: slices are orthogonal to it.
    cell
        (M, 3) indices of the cell in which each posture's TCP is.
    q, poses, dexterity
        (M, n) commands of the postures, m or rad, their poses, base frame, and their dexterity.
    volume
        Volume, m^3, of the cells in which some posture's TCP is.
    """

    axes: tuple[Floats, Floats, Floats]
    across: int
    cell: npt.NDArray[np.intp]
    q: Floats
    poses: Poses
    dexterity: ChainDexterity
    volume: float

    @property
    def reachable(self) -> Mask:
        """(nx, ny, nz) whether the TCP of a posture is in the cell."""
        there = np.zeros([len(axis) for axis in self.axes], dtype=bool)
        there[tuple(self.cell.T)] = True
        return there

    def on_grid(self, values: Floats) -> Floats:
        """(nx, ny, nz) median of the finite ``values`` (M,) in each cell; NaN where there is none."""
        table = np.full([len(axis) for axis in self.axes], np.nan)
        good = np.isfinite(values)
        place = np.ravel_multi_index(tuple(self.cell[good].T), table.shape)
        there = np.unique(place)
        if there.size:
            table.flat[there] = median(values[good], place, there)
        return table


def chain_commands(model: Model, count: int, seed: int) -> Floats:
    """(N, n) reachable commands, m or rad, that fill the joints' ranges (Halton); -pi to pi for a joint without limits.

    Those near a singularity of a robot with loops are left out.

    ``count``: number of commands before some are left out.
    """
    from scipy.stats import qmc

    robot = model.robot
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    q = lower + (upper - lower) * qmc.Halton(robot.n_actuators, rng=seed).random(count)
    kinematics = model.kinematics
    poses = kinematics.forward(q)
    q, poses = q[poses.reached], poses[poses.reached]
    if robot.constraints:
        gain = np.linalg.norm(kinematics.command_jacobian(q, poses)[:, :6], axis=(1, 2))
        at_home = np.linalg.norm(kinematics.command_jacobian(robot.home_q[None], kinematics.home)[0, :6])
        q = q[gain <= CONDITIONED * at_home]
    return np.asarray(q)


def chain_workspace(model: Model, seed: int = 0) -> ChainWorkspace:
    """The cells in which the TCP is, for many postures.

    Raises
    ------
    UnreachableError
        If no posture can be reached.
    """
    endless = len(model.robot.constraints) > 0 and not np.isfinite(model.robot.upper - model.robot.lower).all()
    q = chain_commands(model, ENDLESS if endless else POSTURES, seed)
    if not len(q):
        raise UnreachableError(f"{model.robot.name} reaches none of its range", hint="check the joints' limits")
    poses = model.kinematics.forward(q)
    low, extent = poses.T.min(axis=0), np.ptp(poses.T, axis=0)
    across = int(np.argmin(extent))
    counts = np.where(extent < FLAT, 1, np.where(np.arange(3) == across, COUNTS[0], COUNTS[1]))
    size = np.where(extent < FLAT, 1.0, extent / counts)
    cell = np.clip(((poses.T - low) / size).astype(int), 0, counts - 1)
    x, y, z = (low[i] + size[i] * (np.arange(counts[i]) + 0.5 * (extent[i] >= FLAT)) for i in range(3))
    reached = len(np.unique(cell, axis=0))
    volume = 0.0 if (extent < FLAT).any() else reached * float(np.prod(size))
    return ChainWorkspace((x, y, z), across, cell, q, poses, chain_dexterity(model, q, poses), volume)


def chain_dexterity(model: Model, q: Floats, poses: Poses) -> ChainDexterity:
    """The dexterity at commands q (N, n), whose poses, base frame, are known."""
    J = model.kinematics.command_jacobian(q, poses)[:, :6]
    gain = np.linalg.svd(J[:, :3], compute_uv=False)
    reach = float(np.sqrt(((poses.T - poses.T.mean(axis=0)) ** 2).sum(axis=1).mean()))
    least = np.linalg.svd(np.concatenate([J[:, :3], reach * J[:, 3:]], axis=1), compute_uv=False)[:, -1]
    robot = model.robot
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = gain[:, 0] / gain[:, -1]
    return ChainDexterity(
        position_gain=np.asarray(gain, dtype=np.float64),
        rotation_gain=np.asarray(np.linalg.svd(J[:, 3:], compute_uv=False), dtype=np.float64),
        condition=condition,
        singularity=least / max(float(least.max()), 1e-300),
        limit=np.minimum(q - robot.lower, robot.upper - q).min(axis=1),
    )
