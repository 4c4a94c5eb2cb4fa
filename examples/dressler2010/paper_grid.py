"""The grid of the paper's first measurement set: its limits are not printed, Table III and the count of poses give them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from paper_tables import tables
from scipy.optimize import least_squares

from gtpin.accuracy.sensitivity import PARAMETERS, STEP, of_rod
from gtpin.errors import UnreachableError
from gtpin.kinematics.inverse import commands_for
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import zyz_rates
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]

SHAPE = (6, 6, 5)
"""Layers, and rows and columns of each. The paper prints the layers, and 176 poses in all; six by five is the nearest."""
OF_ALL = ("L", "Px", "Py", "Pz", "Cx", "Cy", "Cz")
"""The rows of Table III that mean the same for all links; the others are track directions, or Euler angles for 2a and 2b."""
MODEL_ERROR = 0.03
"""What the mean over a grid misses of a sum over 61 of its poses, relative: about what the fit leaves."""
COUNT = 2.0
"""What a grid's count of poses within the range misses of the paper's: which 4 of 180 were left out is not known."""
VAGUE = 0.5
"""Weak prior on each number, m, around a grid that fills the actuator range and is a metre wide across it."""
STARTS = (-0.15, 0.0, 0.15)
"""Centres along the tracks, m, from which the fit starts: as layers leave the range one by one it has several minima."""
EDGE = 0.02
"""Width, m, over which a point at the edge of the actuator range fades out during the fit, to keep the cost smooth."""


@dataclass(frozen=True)
class Grid:
    """A grid of TCP positions in layers orthogonal to the tracks.

    Parameters
    ----------
    center
        (3,) its centre less the TCP at home, base frame, m.
    half_width
        (3,) half its size along the tracks, across them in the base frame's x-y plane, and across both, m. The tracks follow
        x to 4 degrees, so that these are nearly the base frame's axes.
    """

    center: Floats
    half_width: Floats

    def places(self, kinematics: Kinematics, unit: Floats) -> Floats:
        """(N, 3) positions, base frame, m, of places (N, 3) in the grid, each from -1 to 1 along its axes."""
        robot = kinematics.robot
        along = np.mean([robot.actuators[i].axis for i in robot.rod_carriers if i is not None], axis=0)
        across = np.cross([0.0, 0.0, 1.0], along)
        axes = np.array([along, across, np.cross(along, across)])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        return np.asarray(kinematics.home.T[0] + self.center + (unit * self.half_width) @ axes)

    def points(self, kinematics: Kinematics) -> Floats:
        """(180, 3) positions, base frame, m, layer after layer, each walked back along the path of the one before."""
        x, y, z = (np.linspace(-1.0, 1.0, count) for count in SHAPE)
        walk = []
        for i, layer in enumerate(x):
            rows = [(layer, across, up) for j, across in enumerate(y) for up in (z if j % 2 == 0 else z[::-1])]
            walk += rows if i % 2 == 0 else rows[::-1]
        return self.places(kinematics, np.array(walk))

    def all_commands(self, model: Model) -> tuple[Floats, Poses]:
        """(180, 3) commands of all points, and the poses there.

        Raises
        ------
        UnreachableError
            If the model can't reach a point.
        """
        kinematics = model.kinematics
        q, poses = commands_for(kinematics, self.points(kinematics))
        if not poses.reached.all():
            raise UnreachableError(f"{model.robot.name} can't reach the whole grid", hint="make it smaller")
        return q, poses

    def commands(self, model: Model) -> Floats:
        """(N, 3) commands of the points within the actuator range, as the paper leaves out those beyond it."""
        q, _ = self.all_commands(model)
        lower, upper = tables().measurement.actuator_range
        return q[((q >= lower) & (q <= upper)).all(axis=1)]


RECOVERED = Grid(np.array([0.143, 0.151, -0.161]), np.array([0.495, 0.475, 0.465]))
"""What :func:`recover_grid` gives for the shipped Gantry-Tau, to the millimetre."""


def recover_grid(model: Model, starts: Sequence[float] = STARTS) -> Grid:
    """Fit the grid's six numbers to the 108 numbers of S_pos and S_rot in Table III that links 1 to 3c have in common with
    gtpin's parameters, and to the number of poses within the actuator range; to nothing else.

    Sums over 61 validation poses are taken as 61 times the mean over the grid, and both signs of the step. Numbers count
    relative to their size, with what their rounding hides. How far the grid reaches along its parallel tracks is told by the
    rows of the track directions, whose effect grows with the command, and by the count.

    Parameters
    ----------
    starts
        Centres along the tracks to start from, m; the best fit is kept.
    """
    kinematics = model.kinematics
    facts = tables().measurement
    lower, upper = facts.actuator_range
    there = np.array([[name in OF_ALL or source == 3 for source in tables().source] for name in PARAMETERS])
    printed = [np.array([t[name] for name in PARAMETERS]) for t in (tables().position_mm, tables().rotation_rad)]
    sigma = [np.hypot(MODEL_ERROR, _rounding(p) / p) for p in printed]
    kept = 2.0 * facts.calibration_poses / facts.tcp_poses * float(np.prod(SHAPE))
    prior = np.array([(lower + upper) / 2.0, 0.0, 0.0, (upper - lower) / 2.0, VAGUE, VAGUE])

    def misfit(x: Floats) -> Floats:
        q, poses = commands_for(kinematics, Grid(x[:3], x[3:]).points(kinematics))
        inside = np.minimum(q - lower, upper - q).min(axis=1)
        weight = 1.0 / (1.0 + np.exp(-np.clip(np.where(poses.reached, inside, -1.0) / EDGE, -50.0, 50.0)))
        near = weight > 1e-9
        slopes = _step_slopes(kinematics, q[near], poses[near], PARAMETERS)
        share = 2.0 * STEP * facts.calibration_poses / weight.sum()
        sums = [share * np.einsum("n,nrk->rk", weight[near], s) for s in slopes]
        sums[0] *= 1e3
        off = [((ours / p - 1.0) / s)[there] for ours, p, s in zip(sums, printed, sigma, strict=True)]
        return np.concatenate([*off, (x - prior) / VAGUE, [(weight.sum() - kept) / COUNT]])

    found = []
    for start in starts:
        x = np.array([start, 0.15, -0.15, 0.5, 0.5, 0.5])
        found.append(least_squares(misfit, x, diff_step=np.full(6, 1e-3), xtol=1e-6, ftol=1e-6))
    best = min(found, key=lambda result: float(result.cost))
    return Grid(best.x[:3], best.x[3:])


def _rounding(printed: Floats) -> Floats:
    """Standard deviation of what rounding took from Table III's numbers: lengths have one decimal, angles two digits."""
    half = np.where(printed >= 0.1, 0.05, 0.5 * 10.0 ** (np.floor(np.log10(printed)) - 1.0))
    return np.asarray(half / np.sqrt(3.0))


def _step_slopes(kinematics: Kinematics, q: Floats, poses: Poses, parameters: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Size of the TCP's motion per unit of each parameter of each rod, from the Jacobian.

    ``q``, ``poses``: (N, n) commands, m or rad, and (N) their poses, base frame. ``parameters``: some of
    :data:`~gtpin.accuracy.sensitivity.PARAMETERS`; results are NaN where a rod has no such parameter.

    Returns (N, len(parameters), k) each: length of the TCP's displacement, and sum of the absolute changes of the ZYZ
    angles.
    """
    robot, rates = kinematics.robot, zyz_rates(poses.R)
    motion, found = kinematics.motion(q, poses), np.full((2, len(q), len(parameters), len(robot.rods)), np.nan)
    for row, parameter in enumerate(parameters):
        for rod in range(len(robot.rods)):
            change = of_rod(robot, q, motion, parameter, rod)
            if change is not None:
                moved = change.rate(motion)
                found[0, :, row, rod] = np.linalg.norm(moved[:, :3], axis=1)
                found[1, :, row, rod] = np.abs(np.einsum("nij,nj->ni", rates, moved[:, 3:])).sum(axis=1)
    return found[0], found[1]
