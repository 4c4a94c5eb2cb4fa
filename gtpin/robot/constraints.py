"""The closure equations of a robot's loops and their derivative, at the posture that Pinocchio's data hold."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from gtpin.robot.chain import Chain
from gtpin.typing import Floats


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
