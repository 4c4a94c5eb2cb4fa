"""Newton's method on the closure constraints of the Pinocchio model, and the test of its contraction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.linalg import lapack

from gtpin.robot.chain import Chain
from gtpin.robot.constraints import constraint_error, constraint_jacobian
from gtpin.typing import Floats

MAX_STEPS = 12
ROUNDING = 16.0 * float(np.finfo(float).eps)
CONTRACTION = 0.25
"""Largest ratio of the second Newton step to the first at which the start counts as near enough (Deuflhard, Newton
Methods for Nonlinear Problems, 2011, ch. 5: the monotonicity test of path continuation)."""
CHANGE = 0.5
"""Largest relative change of the closures' derivative between two postures of a path; 1 could be at a singularity. Assumed."""


@dataclass(frozen=True)
class Closing:
    """Result of Newton's method.

    - ``configuration``: Pinocchio configuration at the last iterate.
    - ``jacobian``: (m, nv) constraint Jacobian at the last but one iterate, one step from ``configuration``.
    - ``steps``: number of Newton steps.
    - ``closed``: whether the loops are closed to rounding errors, and all steps contracted.
    - ``change``: largest change of the derivative from that nearby: see :meth:`Passive.change`.
    """

    configuration: Floats
    jacobian: Floats
    steps: int
    closed: bool
    change: float


def solve(matrix: Floats, right: Floats, rank: int) -> Floats:
    """Solve a consistent system in the least-squares sense, with the smallest solution; NaN where it is singular.

    ``rank``: rank of the (m, p) matrix at most postures. Where it is less than p, some motions are not determined.
    """
    if rank < matrix.shape[1]:
        return np.asarray(_pseudoinverse(matrix, rank) @ right)
    if matrix.shape[0] == matrix.shape[1]:
        _, _, x, info = lapack.dgesv(matrix, right)
        return np.asarray(x) if info == 0 else np.full(x.shape, np.nan)
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0])


def _pseudoinverse(matrix: Floats, rank: int) -> Floats:
    """(p, m) pseudoinverse of a matrix (m, p) of a known rank; infinite or NaN where its rank is less."""
    left, sizes, rows = np.linalg.svd(matrix, full_matrices=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((rows[:rank].T / sizes[:rank]) @ left[:, :rank].T)


class Passive:
    """The inverse of the derivative (m, p) of the closure constraints by the passive coordinates.

    ``rank``: its rank at most postures; see :func:`solve`.

    Attributes
    ----------
    inverse : (p, m) array
        The pseudo-inverse where there are more equations than coordinates, or motions that are not determined; NaN where the
        matrix is singular.
    amplification : float
        Frobenius norm of the inverse: motion of the passive coordinates by unit closure errors; infinite where the matrix is
        singular.
    """

    def __init__(self, matrix: Floats, rank: int) -> None:
        self.amplification = 1.0
        self._matrix = matrix
        if not matrix.size:
            self.inverse = np.zeros(matrix.shape[::-1])
            return
        if matrix.shape[0] != matrix.shape[1] or rank < matrix.shape[1]:
            self.inverse = _pseudoinverse(matrix, rank)
        else:
            lu, pivots, info = lapack.dgetrf(matrix)
            # LAPACK is called directly: numpy takes several times as long for a matrix of this size.
            self.inverse = lapack.dgetri(lu, pivots)[0] if info == 0 else np.full(matrix.shape, np.nan)
        self.amplification = math.sqrt(np.vdot(self.inverse, self.inverse))
        if not math.isfinite(self.amplification):
            self.amplification = np.inf

    def change(self, matrix: Floats) -> float:
        """Change from this derivative to another one, relative to the distance of this one from a singularity.

        The Frobenius norm of inverse * (other - this): below 1, no singularity is on the straight line between the two.
        """
        moved = self.inverse @ (matrix - self._matrix)
        return math.sqrt(np.vdot(moved, moved))


def close(
    robot: Chain,
    configuration: Floats,
    near: Passive | None = None,
    contraction: float = CONTRACTION,
    change: float = np.inf,
) -> Closing:
    """Close the loops by Newton's method on the passive coordinates, at constant commands.

    ``configuration``: (nq,) Pinocchio configuration to start from. ``near``: the derivative of the closures at a closed
    posture nearby; None: that at the start. ``contraction``: bound on the ratio of successive steps. ``change``: bound on
    the change of this derivative from ``near`` to the start and to the result: see :meth:`Passive.change`. With one below
    1, no singularity is between the two: the closed posture has the assembly mode of the one nearby. No bound by default.
    """
    model, passive = robot.model, robot.passive
    # Coordinates of a few metres have rounding errors of a few 1e-16 m each, and a loop is a sum of about ten of them.
    rounding = ROUNDING * robot.size
    last_step, rank, largest = np.inf, robot.rank, 0.0
    jacobian: Floats | None = None
    own = np.zeros((0, 0))
    for steps in range(MAX_STEPS + 1):
        pin.computeJointJacobians(model, robot.data, configuration)
        error = constraint_error(robot)
        closed = bool(error.size == 0 or np.abs(error).max() <= rounding)
        if not closed or jacobian is None:
            jacobian = constraint_jacobian(robot)
            own = jacobian[:, passive]
            near = near or Passive(own, rank)
        assert near is not None
        if closed or steps == 0:
            largest = max(largest, near.change(own))
            if not largest <= change:
                break
        if closed:
            return Closing(configuration, jacobian, steps, True, largest)
        velocity = robot.velocity(None, solve(own, -error, rank))
        step = math.sqrt(velocity @ velocity)
        # Steps below the square root of rounding errors no longer shrink; there only the closure error decides.
        if not math.isfinite(step) or (step > 1e-8 and step > contraction * last_step):
            break
        last_step = step
        configuration = pin.integrate(model, configuration, velocity)
    assert jacobian is not None
    return Closing(configuration, jacobian, steps, False, largest)
