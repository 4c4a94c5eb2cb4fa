"""The paper's own calibration: squared closure residuals at measured poses, each rod separately (eq. 6)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

import gtpin
from gtpin.comparison.compare import within_tracks
from gtpin.data import random
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import from_quaternions
from gtpin.paper.geometry import PaperGeometry
from gtpin.paper.kinematics import PaperKinematics
from gtpin.paper.models import MODELS, model_geometry

Floats = npt.NDArray[np.float64]

ROUNDS = 4
"""Number of fits. Each weighs the closures by the size of the residuals of the fit before it."""


def closure_residual(rods: PaperKinematics, q: Floats, poses: Poses) -> Floats:
    """(N, k) L^2 - \\|T + R P - C\\|^2 at measured poses, base frame, m^2 (eqs. 1 and 5)."""
    ends = rods.ends(q)
    return np.asarray(ends.L**2 - (ends.vectors(_of_the_arm(rods, poses)) ** 2).sum(axis=2))


def residual_slopes(rods: PaperKinematics, q: Floats, poses: Poses) -> Floats:
    """(N, k, p) derivative of the closure residuals at measured poses by the parameters."""
    arm, ends = _of_the_arm(rods, poses), rods.ends(q)
    d, found = ends.vectors(arm), np.zeros((len(q), len(rods.seats), len(rods.geometry.parameters)))
    for column, i, what, change in rods.changes(q):
        if what == "L":
            found[:, i, column] = 2.0 * ends.L[i] * change[..., 0]
        else:
            moved = -arm.R @ change if what == "P" else change
            found[:, i, column] = 2.0 * np.einsum("nj,nj->n", d[:, i], moved)
    return found


def with_rods(geometry: gtpin.Geometry) -> PaperKinematics:
    """The kinematics of a geometry, with the paper's C(q)."""
    if not isinstance(geometry, PaperGeometry):
        geometry = PaperGeometry(geometry.robot, geometry.parameters, geometry.values)
    return PaperKinematics(geometry)


def _of_the_arm(rods: PaperKinematics, poses: Poses) -> Poses:
    """The poses as the arm's model has them: the plate of a reduced arm never turns, whatever was measured (eq. 1)."""
    return Poses(poses.T, np.broadcast_to(rods.home.R[0], poses.R.shape)) if rods.geometry.positions_only else poses


def closure_costs(geometry: gtpin.Geometry, q: Floats, poses: Poses) -> Floats:
    """(k,) squared closure residual of each rod, summed over the poses, m^4: Table II's last column."""
    return np.asarray((closure_residual(with_rods(geometry), q, poses) ** 2).sum(axis=0))


def fit_closures(geometry: gtpin.Geometry, q: Floats, poses: Poses) -> gtpin.Geometry:
    """Minimise the squared closure residuals, with tolerances as priors for what the poses do not determine.

    Where no parameter belongs to two rods, this is a separate fit for each rod. The measured poses are regressors, so that
    their noise, mainly that of the orientation, biases the joints' positions. The paper's fit had no priors: it then ends at a
    point that depends on the solver, centimetres away along unobservable directions.

    ``geometry``: the nominal geometry, with the parameters to identify. ``q``, ``poses``: (N, n) commands within the tracks and
    (N) measured poses, base frame.
    """
    x = np.zeros(len(geometry.parameters))  # deviations, in units of the tolerances

    def at(x: Floats) -> PaperKinematics:
        return with_rods(geometry.with_values(geometry.values + geometry.tolerance * x))

    for _ in range(ROUNDS):
        weight = 1.0 / np.sqrt((closure_residual(at(x), q, poses) ** 2).mean(axis=0))

        def residual(x: Floats, weight: Floats = weight) -> Floats:
            return np.concatenate([(weight * closure_residual(at(x), q, poses)).ravel(), x])

        def jacobian(x: Floats, weight: Floats = weight) -> Floats:
            J = residual_slopes(at(x), q, poses)
            return np.concatenate([(weight[:, None] * J * geometry.tolerance).reshape(-1, len(x)), np.eye(len(x))])

        x = least_squares(residual, x, jacobian, method="lm").x
    return at(x).geometry


def measured_poses(dataset: gtpin.Dataset) -> Poses:
    """The measured poses of a dataset that has orientations."""
    return Poses(dataset.position, from_quaternions(dataset.orientation))


def held_out(dataset: gtpin.Dataset, models: Sequence[int] = MODELS, parts: int = 2) -> tuple[Floats, Floats]:
    """What models leave of each part of the poses within the tracks, fitted to the other parts by the closure cost.

    Returns (m, N) position errors, m, and (m, k) squared closure residuals of each rod, summed over the poses, m^4.
    """
    robot = gtpin.load_robot(dataset.robot)
    dataset = dataset.take(within_tracks(robot, dataset))
    errors, costs = np.empty((len(models), len(dataset))), np.zeros((len(models), len(robot.rods)))
    for rows in random(dataset, parts):
        fitted, held = dataset.take(~rows), dataset.take(rows)
        for i, number in enumerate(models):
            geometry = fit_closures(model_geometry(number, robot, fitted), fitted.q, measured_poses(fitted))
            errors[i, rows] = np.linalg.norm(held.position - gtpin.Model(geometry).predict(held.q).T, axis=1)
            costs[i] += closure_costs(geometry, held.q, measured_poses(held))
    return errors, costs


def better_measured(dataset: gtpin.Dataset) -> npt.NDArray[np.bool_]:
    """(k,) by rod, whether model 4 predicts the closures of left-out poses better than model 3: the choice of model 5."""
    _, (straight, measured) = held_out(dataset, (3, 4), parts=5)
    return np.asarray(measured < straight)
