"""Newton's method on the closure constraints of the Pinocchio model, and the test of its contraction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.linalg import lapack

from gtpin.robot.chain import Chain

Floats = npt.NDArray[np.float64]

MAX_STEPS = 12
CONTRACTION = 0.25
"""Largest ratio of the second Newton step to the first at which the start counts as near enough (Deuflhard, Newton
Methods for Nonlinear Problems, 2011, ch. 5: the monotonicity test of path continuation)."""


@dataclass(frozen=True)
class Closing:
    """Outcome of one Newton solve.

    Parameters
    ----------
    configuration
        Pinocchio configuration at the last iterate.
    jacobian
        (m, nv) constraint Jacobian there.
    steps
        Newton steps taken.
    closed
        Whether the loops are closed to rounding, with contracting steps all along.
    """

    configuration: Floats
    jacobian: Floats
    steps: int
    closed: bool


def constraint_error(robot: Chain) -> Floats:
    """(m,) gap between the anchors of each loop, m, in the first anchor's frame, for the data as last computed."""
    errors = np.empty(3 * len(robot.constraints))
    for i, (constraint, data) in enumerate(zip(robot.constraints, robot.constraint_data, strict=True)):
        constraint.calc(robot.model, robot.data, data)
        errors[3 * i : 3 * i + 3] = data.constraint_position_error
    return errors


def constraint_jacobian(robot: Chain) -> Floats:
    """(m, nv) derivative of :func:`constraint_error`, for the data as last computed."""
    jacobian = np.empty((3 * len(robot.constraints), robot.model.nv))
    for i, (constraint, data) in enumerate(zip(robot.constraints, robot.constraint_data, strict=True)):
        jacobian[3 * i : 3 * i + 3] = constraint.jacobian(robot.model, robot.data, data)
    return jacobian


def solve(matrix: Floats, right: Floats) -> Floats:
    """Solve a square system, or a consistent overdetermined one in the least-squares sense; NaN where it is singular."""
    if matrix.shape[0] == matrix.shape[1]:
        _, _, x, info = lapack.dgesv(matrix, right)
        return np.asarray(x) if info == 0 else np.full(x.shape, np.nan)
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0])


def close(robot: Chain, configuration: Floats, contraction: float = CONTRACTION) -> Closing:
    """Close the loops by Newton's method on the passive coordinates, the actuators held.

    Parameters
    ----------
    configuration
        (nq,) Pinocchio configuration to start from.
    contraction
        Bound on the ratio of successive steps.
    """
    model, passive = robot.model, robot.passive
    # Coordinates of a few metres are rounded to a few 1e-16 m each, and a loop adds a dozen of them.
    rounding = 16.0 * np.finfo(float).eps * robot.size
    velocity = np.zeros(model.nv)
    last_step = np.inf
    for steps in range(MAX_STEPS + 1):
        pin.computeJointJacobians(model, robot.data, configuration)
        error = constraint_error(robot)
        jacobian = constraint_jacobian(robot)
        if error.size == 0 or np.abs(error).max() <= rounding:
            return Closing(configuration, jacobian, steps, True)
        velocity[passive] = solve(jacobian[:, passive], -error)
        step = float(np.linalg.norm(velocity))
        # Below the square root of rounding, steps no longer shrink; the error decides alone.
        if not np.isfinite(step) or (step > 1e-8 and step > contraction * last_step):
            break
        last_step = step
        configuration = pin.integrate(model, configuration, velocity)
    return Closing(configuration, jacobian, steps, False)


@dataclass(frozen=True)
class PassiveInverse:
    """Inverse of the constraints' Jacobian by the passive coordinates.

    Parameters
    ----------
    inverse
        (p, m) the inverse; the pseudo-inverse where there are more equations than coordinates.
    norm
        Its Frobenius norm: infinite where it does not exist.
    orientation
        Sign of the determinant, which is constant on an assembly mode; 1 where the matrix is not square.
    """

    inverse: Floats
    norm: float
    orientation: float


def invert(matrix: Floats) -> PassiveInverse:
    """Invert the (m, p) derivative of the closure equations by the passive coordinates."""
    if matrix.size == 0:
        return PassiveInverse(np.zeros(matrix.shape[::-1]), 1.0, 1.0)
    if matrix.shape[0] != matrix.shape[1]:
        inverse = np.asarray(np.linalg.pinv(matrix), dtype=np.float64)
        return PassiveInverse(inverse, float(np.linalg.norm(inverse)), 1.0)
    lu, pivots, info = lapack.dgetrf(matrix)
    if info != 0:
        return PassiveInverse(np.full(matrix.shape, np.nan), np.inf, 0.0)
    inverse = lapack.dgetri(lu, pivots)[0]
    swaps = np.count_nonzero(pivots != np.arange(len(pivots)))
    sign = np.prod(np.sign(lu.diagonal())) * (-1.0) ** swaps
    return PassiveInverse(np.ascontiguousarray(inverse), float(np.linalg.norm(inverse)), float(sign))
