"""Newton's method on the closure constraints of the Pinocchio model, and the test of its contraction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.linalg import lapack

from gtpin.robot.chain import Chain

Floats = npt.NDArray[np.float64]

MAX_STEPS = 12
ROUNDING = 16.0 * float(np.finfo(float).eps)
CONTRACTION = 0.25
"""Largest ratio of the second Newton step to the first at which the start counts as near enough (Deuflhard, Newton
Methods for Nonlinear Problems, 2011, ch. 5: the monotonicity test of path continuation)."""


@dataclass(frozen=True)
class Closing:
    """Result of Newton's method.

    Parameters
    ----------
    configuration
        Pinocchio configuration at the last iterate.
    jacobian
        (m, nv) constraint Jacobian at the last but one iterate, one step from ``configuration``.
    steps
        Number of Newton steps.
    closed
        Whether the loops are closed to rounding errors, and all steps contracted.
    """

    configuration: Floats
    jacobian: Floats
    steps: int
    closed: bool


def constraint_error(robot: Chain) -> Floats:
    """(m,) components of the vectors between the anchors of each loop, m, in the first anchor's frame.

    They are at the configuration for which ``robot.data`` was computed last.

    For planar loops only the components in their plane: see :meth:`~gtpin.robot.chain.Chain.closing`.
    """
    if not robot.constraints:
        return np.zeros(0)
    gaps = []
    for constraint, data in robot.constraint_pairs:
        constraint.calc(robot.model, robot.data, data)
        gaps.append(data.constraint_position_error)
    return robot.closing(np.concatenate(gaps))


def constraint_jacobian(robot: Chain) -> Floats:
    """(m, nv) derivative of :func:`constraint_error`; joints that follow others (``<mimic>``) move with them."""
    if not robot.constraints:
        return np.zeros((0, robot.model.nv))
    for constraint, data in robot.constraint_elements:
        constraint.calc(robot.model, robot.data, data)
    jacobian = np.asarray(pin.getConstraintsJacobian(robot.model, robot.data, *robot.constraint_vectors))
    return robot.closing(robot.folded(jacobian.reshape(-1, robot.model.nv)))


def solve(matrix: Floats, right: Floats) -> Floats:
    """Solve a square system, or a consistent overdetermined one in the least-squares sense; NaN where it is singular."""
    if matrix.shape[0] == matrix.shape[1]:
        _, _, x, info = lapack.dgesv(matrix, right)
        return np.asarray(x) if info == 0 else np.full(x.shape, np.nan)
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0])


def close(robot: Chain, configuration: Floats, contraction: float = CONTRACTION) -> Closing:
    """Close the loops by Newton's method on the passive coordinates, at constant commands.

    Parameters
    ----------
    configuration
        (nq,) Pinocchio configuration to start from.
    contraction
        Bound on the ratio of successive steps.
    """
    model, passive = robot.model, robot.passive
    # Coordinates of a few metres have rounding errors of a few 1e-16 m each, and a loop is a sum of about ten of them.
    rounding = ROUNDING * robot.size
    last_step = np.inf
    jacobian: Floats | None = None
    for steps in range(MAX_STEPS + 1):
        pin.computeJointJacobians(model, robot.data, configuration)
        error = constraint_error(robot)
        if error.size == 0 or np.abs(error).max() <= rounding:
            return Closing(configuration, constraint_jacobian(robot) if jacobian is None else jacobian, steps, True)
        jacobian = constraint_jacobian(robot)
        velocity = robot.velocity(None, solve(jacobian[:, passive], -error))
        step = math.sqrt(velocity @ velocity)
        # Steps below the square root of rounding errors no longer shrink; there only the closure error decides.
        if not math.isfinite(step) or (step > 1e-8 and step > contraction * last_step):
            break
        last_step = step
        configuration = pin.integrate(model, configuration, velocity)
    return Closing(configuration, constraint_jacobian(robot) if jacobian is None else jacobian, steps, False)


class Passive:
    """The inverse of the derivative (m, p) of the closure constraints by the passive coordinates.

    Attributes
    ----------
    inverse : (p, m) array
        The pseudo-inverse where there are more equations than coordinates; NaN where the matrix is singular.
    amplification : float
        Frobenius norm of the inverse: motion of the passive coordinates by unit closure errors; infinite where the matrix is
        singular.
    orientation : float
        Sign of the determinant, which is constant within an assembly mode; 1 where the matrix is not square.
    """

    def __init__(self, matrix: Floats) -> None:
        self.orientation, self.amplification = 1.0, 1.0
        if not matrix.size:
            self.inverse = np.zeros(matrix.shape[::-1])
            return
        if matrix.shape[0] != matrix.shape[1]:
            self.inverse = np.asarray(np.linalg.pinv(matrix), dtype=np.float64)
        else:
            lu, pivots, info = lapack.dgetrf(matrix)
            if info != 0:
                self.inverse = np.full(matrix.shape, np.nan)
                self.orientation, self.amplification = 0.0, np.inf
                return
            # LAPACK is called directly: numpy would factorise once for the determinant and again for the inverse.
            self.inverse = lapack.dgetri(lu, pivots)[0]
            negative = np.count_nonzero(lu.diagonal() < 0.0) + np.count_nonzero(pivots != np.arange(len(pivots)))
            self.orientation = -1.0 if negative % 2 else 1.0
        self.amplification = math.sqrt(np.vdot(self.inverse, self.inverse))
