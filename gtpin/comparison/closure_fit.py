"""The paper's own calibration: squared closure residuals at measured poses, each rod separately (eq. 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.errors import ConvergenceError, DatasetError
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

MAX_STEPS = 200
DAMPING = 1e-7
"""First damping: small, because the closures are nearly linear in the geometry, and the cost is a narrow valley."""
ROUNDS = 4
"""Number of fits with tolerances as priors. Each weighs the closures by the size of the residuals of the fit before it."""
SMALLEST = 1e-9
"""Smallest size of the residuals, m^2, for these weights: 2 L dL of a rod of 2 m whose length is off by a quarter of a
nanometre. Assumed."""


@dataclass(frozen=True)
class ClosureFit:
    """A geometry that makes the closures of measured poses small.

    ``cost``: (k,) sum over the poses of each rod's squared closure residual, m^4: Table II's last column.
    """

    geometry: Geometry
    cost: Floats


def closure_residual(geometry: Geometry, q: Floats, poses: Poses) -> Floats:
    """(N, k) L^2 - \\|T + R P - C\\|^2 at measured poses, base frame, m^2 (eqs. 1 and 5)."""
    return np.asarray(-2.0 * RodKinematics(geometry).closures(q, _of_the_arm(geometry, poses)))


def _of_the_arm(geometry: Geometry, poses: Poses) -> Poses:
    """The poses as the arm's model has them: the plate of a reduced arm never turns, whatever was measured (eq. 1)."""
    if not geometry.reduced:
        return poses
    return Poses(poses.T, np.broadcast_to(RodKinematics(geometry).home.R[0], poses.R.shape))


def fit_closures(geometry: Geometry, q: Floats, poses: Poses, *, priors: bool = True) -> ClosureFit:
    """Minimise the squared closure residuals by Levenberg-Marquardt.

    Where no parameter belongs to two rods, this is a separate fit for each rod. The measured poses are regressors, so that
    their noise, mainly that of the orientation, biases the joints' positions.

    ``geometry``: the nominal geometry, with the parameters to identify. ``q``, ``poses``: (N, n) commands and (N) measured
    poses, base frame. ``priors``: whether tolerances are priors for what the poses do not determine. The paper's fit had no
    priors: it then ends at a point that depends on the solver, centimetres away along unobservable directions.

    Raises `DatasetError` if there are no poses, or one is outside the measured tracks. `ConvergenceError` if the fit does
    not converge.
    """
    if not len(q):
        raise DatasetError("no poses to fit", hint="measure some")
    if geometry.outside_tracks(q).any():
        raise DatasetError("a pose lies outside the measured tracks", hint="leave it out")
    x, weight = np.zeros(len(geometry.parameters)), np.ones(len(geometry.robot.rod_sites))
    for _ in range(ROUNDS if priors else 1):
        if priors:
            residual = closure_residual(_moved(geometry, x), q, poses)
            weight = 1.0 / np.maximum(np.sqrt((residual**2).mean(axis=0)), SMALLEST)
        x = _minimise(geometry, q, poses, x, weight, 1.0 if priors else 0.0)
    found = _moved(geometry, x)
    return ClosureFit(found, np.asarray((closure_residual(found, q, poses) ** 2).sum(axis=0)))


def _moved(geometry: Geometry, x: Floats) -> Geometry:
    """The geometry with deviations x (p,), in units of the tolerances, from where the fit started."""
    return geometry.with_values(geometry.values + geometry.tolerance * x)


def _minimise(geometry: Geometry, q: Floats, poses: Poses, x: Floats, weight: Floats, prior: float) -> Floats:
    def at(x: Floats) -> tuple[Geometry, Floats]:
        moved = _moved(geometry, x)
        return moved, closure_residual(moved, q, poses) * weight

    here, r = at(x)
    cost, damping = float((r**2).sum() + prior * (x**2).sum()), DAMPING
    for _ in range(MAX_STEPS):
        gradient = RodKinematics(here).closure_gradient(q, _of_the_arm(here, poses))
        J = (-2.0 * weight[:, None] * gradient * geometry.tolerance).reshape(r.size, -1)
        A, g = J.T @ J + prior * np.eye(len(x)), -(J.T @ r.ravel()) - prior * x
        while True:
            step = np.linalg.lstsq(A + damping * np.diag(np.maximum(np.diag(A), 1e-300)), g, rcond=None)[0]
            trial, trial_r = at(x + step)
            trial_cost = float((trial_r**2).sum() + prior * ((x + step) ** 2).sum())
            if trial_cost <= cost:
                break
            damping *= 10.0
            if damping > 1e16:
                return x  # no direction lowers the cost beyond rounding
        gained = cost - trial_cost
        x, here, r, cost, damping = x + step, trial, trial_r, trial_cost, max(damping / 10.0, 1e-12)
        if gained <= 1e-9 * max(cost, 1e-300):
            return x
    what = f"the closure fit has not converged in {MAX_STEPS} steps"
    raise ConvergenceError(what, hint="keep the tolerances as priors, or measure more poses")
