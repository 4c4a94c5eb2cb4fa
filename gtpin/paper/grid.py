"""The grid of the paper's first measurement set, whose limits are not printed, recovered from Table III."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from gtpin.accuracy.rods import rod_kinematics
from gtpin.accuracy.sensitivity import position_slopes
from gtpin.errors import UnreachableError
from gtpin.kinematics.inverse import commands_for
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.model import Model
from gtpin.paper.tables import tables

Floats = npt.NDArray[np.float64]

SHAPE = (6, 6, 5)
"""Layers, and rows and columns of each. The paper prints the layers, and 176 poses in all; six by five is the nearest."""
FITTED = ("L", "Px", "Py", "Pz", "Cx", "Cy", "Cz")
"""The rows of Table III that the grid is fitted to."""
MODEL_ERROR = 0.03
"""What the mean over a grid misses of a sum over 61 of its poses, relative: about what the fit leaves."""
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

    def points(self, kinematics: RodKinematics) -> Floats:
        """(180, 3) positions, base frame, m, layer after layer, each walked back along the path of the one before."""
        x, y, z = (np.linspace(-1.0, 1.0, count) for count in SHAPE)
        walk = []
        for i, layer in enumerate(x):
            rows = [(layer, across, up) for j, across in enumerate(y) for up in (z if j % 2 == 0 else z[::-1])]
            walk += rows if i % 2 == 0 else rows[::-1]
        along = kinematics.v.mean(axis=0)
        across = np.cross([0.0, 0.0, 1.0], along)
        axes = np.array([along, across, np.cross(along, across)])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        return np.asarray(kinematics.home.T[0] + self.center + (np.array(walk) * self.half_width) @ axes)

    def all_commands(self, model: Model) -> tuple[Floats, Poses]:
        """(180, 3) commands of all points, and the poses there.

        Raises
        ------
        UnreachableError
            If the model can't reach a point.
        """
        kinematics = rod_kinematics(model)
        q, poses = commands_for(kinematics, self.points(kinematics))
        if not poses.reached.all():
            raise UnreachableError(f"{model.robot.name} can't reach the whole grid", hint="make it smaller")
        return q, poses

    def commands(self, model: Model) -> Floats:
        """(N, 3) commands of the points within the actuator range, as the paper leaves out those beyond it."""
        q, _ = self.all_commands(model)
        lower, upper = tables().measurement.actuator_range
        return q[((q >= lower) & (q <= upper)).all(axis=1)]


RECOVERED = Grid(np.array([0.024, 0.133, -0.136]), np.array([0.676, 0.482, 0.534]))
"""What :func:`recover_grid` gives for the shipped Gantry-Tau, to the millimetre."""


def recover_grid(model: Model) -> Grid:
    """Fit the grid's six numbers to the 42 numbers of the rows L, P and C of Table III's position changes, and to nothing else.

    The sums over 61 validation poses are taken as 61 times the mean over the grid, and both signs of the step. All
    numbers count alike, relative to their size. Along its parallel tracks the machine is nearly
    the same everywhere, so that these rows hardly tell the grid's extent there: a weak prior says that the layers fill the
    actuator range (to 20 mm), and that the grid is about a metre wide across it (to half a metre).
    """
    kinematics = rod_kinematics(model)
    lower, upper = tables().measurement.actuator_range
    printed = np.array([tables().position_mm[name] for name in FITTED])
    prior = np.array([(lower + upper) / 2.0, 0.0, 0.0, (upper - lower) / 2.0, 0.5, 0.5])
    prior_sigma = np.array([0.02, 0.5, 0.5, 0.02, 0.5, 0.5])

    def misfit(x: Floats) -> Floats:
        q, poses = commands_for(kinematics, Grid(x[:3], x[3:]).points(kinematics))
        inside = np.minimum(q - lower, upper - q).min(axis=1)
        weight = 1.0 / (1.0 + np.exp(-np.clip(np.where(poses.reached, inside, -1.0) / EDGE, -50.0, 50.0)))
        there = poses.reached
        slopes = position_slopes(model, q[there], poses[there], FITTED)
        mean = np.einsum("n,nrk->rk", weight[there], slopes) / weight.sum()
        ours = 1e3 * mean * 2.0 * 5e-5 * tables().measurement.calibration_poses
        return np.concatenate([((ours / printed - 1.0) / MODEL_ERROR).ravel(), (x - prior) / prior_sigma])

    found = least_squares(misfit, prior, diff_step=np.full(6, 1e-3), xtol=1e-6, ftol=1e-6)
    return Grid(found.x[:3], found.x[3:])
