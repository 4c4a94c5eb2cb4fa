"""The closure equations of a robot's loops, their derivative, and the passive motions that they do not determine.

Undetermined are the motion of one joint too many, and the spin of a link that moves nothing.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from gtpin.robot.constrained_model import ConstrainedModel
from gtpin.typing import Floats

Closing = Callable[[Floats], tuple[Floats, float]]

ZERO = 1e-7
"""Ratio to the largest singular value of the closures' derivative below which a singular value is zero. URDFs have five digits
or more, but the closures are exact at home, and a joint that is not needed has a singular value of rounding errors."""
CLEAR = 1e-2
"""Such a ratio at a posture whose loops are closed to some millimetres, above which all passive motions are determined."""
NUDGE = 1e-2
"""Change of the home commands, m and rad, by which a singularity at home is told from a motion that is never determined."""
NEGLIGIBLE = 0.05
"""Smallest weight of a joint that is named."""
NAMED = 8
"""Largest number of joints that are named."""


def constraint_error(robot: ConstrainedModel) -> Floats:
    """(m,) components of the vectors between the anchors of each loop, m, in the first anchor's frame.

    They are at the configuration for which ``robot.data`` was computed last.

    For planar loops only the components in their plane: see :meth:`~gtpin.robot.constrained_model.ConstrainedModel.closing`.
    """
    return robot.closing(gaps(robot))


def gaps(robot: ConstrainedModel) -> Floats:
    """(3 L,) vectors between the anchors of each loop, m, in the first anchor's frame, at the posture in ``robot.data``."""
    found = np.zeros(3 * len(robot.constraints))
    for i, (constraint, data) in enumerate(robot.constraint_pairs):
        constraint.calc(robot.model, robot.data, data)
        found[3 * i : 3 * i + 3] = data.constraint_position_error
    return found


def constraint_jacobian(robot: ConstrainedModel) -> Floats:
    """(m, nv) derivative of :func:`constraint_error`; joints that follow others (``<mimic>``) move with them."""
    return robot.closing(gaps_jacobian(robot))


def gaps_jacobian(robot: ConstrainedModel) -> Floats:
    """(3 L, nv) derivative of :func:`gaps`."""
    if not robot.constraints:
        return np.zeros((0, robot.model.nv))
    for constraint, data in zip(*robot.constraint_vectors, strict=True):
        constraint.calc(robot.model, robot.data, data)
    jacobian = np.asarray(pin.getConstraintsJacobian(robot.model, robot.data, *robot.constraint_vectors))
    return robot.folded(jacobian.reshape(-1, robot.model.nv))


def is_determined(robot: ConstrainedModel, configuration: Floats) -> bool:
    """Whether the loops clearly determine all passive motions at a configuration (nq,) whose loops are nearly closed."""
    return not _null_space(_slopes(robot, configuration), CLEAR).shape[1]


def undetermined(robot: ConstrainedModel, home: Floats, close: Closing, notes: list[str]) -> Floats:
    """(n_passive, k) orthonormal basis of the passive motions, m and rad, that leave all loops closed with the commands fixed.

    Where they do not move the TCP, ``notes`` is told their joints.

    ``home``: (nq,) configuration at home, with closed loops. ``close``: closes the loops from another configuration: gives
    the closed one, and the gap that is left, m.

    Raises `RobotError` if such a motion moves the TCP.
    """
    free = _null_space(_slopes(robot, home))
    if not free.shape[1]:
        return free
    nudge = NUDGE * np.random.default_rng(0).uniform(0.5, 1.0, robot.n_actuators)
    there, gap = close(robot.with_commands(home, robot.home_q + nudge))
    near = _null_space(_slopes(robot, there))
    if gap > 1e-9 * robot.size or near.shape[1] < free.shape[1]:
        return np.zeros((robot.n_passive, 0))  # a singularity at home: paths from there say so
    pin.computeJointJacobians(robot.model, robot.data, home)
    frame = pin.getFrameJacobian(robot.model, robot.data, robot.tcp_joint, robot.tcp_placement, pin.LOCAL_WORLD_ALIGNED)
    tcp = robot.folded(np.reshape(np.array(frame), (6, robot.model.nv)))[:, robot.passive] @ free
    what = f"{_counted(free.shape[1])} of {robot.name}"
    named = _named(robot, free)
    if np.abs(tcp).max() > ZERO * robot.size:
        equations = len(constraint_jacobian(robot))
        raise robot.description.error(
            f"{what} can't be determined, and the TCP moves with it: of {named} with the loops closed ({robot.n_passive} "
            f"passive coordinates, {equations} closure equations)",
            "drive one of these joints (<actuator>), make it fixed, or add the <loop_joint> that is missing",
        )
    notes.append(
        f"{what} can't be determined, of {named}; the TCP does not move with it, and it is kept as small as can be"
    )
    return free


def _slopes(robot: ConstrainedModel, configuration: Floats) -> Floats:
    pin.computeJointJacobians(robot.model, robot.data, configuration)
    return constraint_jacobian(robot)[:, robot.passive]


def _null_space(matrix: Floats, zero: float = ZERO) -> Floats:
    _, sizes, rows = np.linalg.svd(matrix)
    rank = int(np.count_nonzero(sizes > zero * sizes.max(initial=0.0)))
    return np.asarray(rows[rank:].T)


def _counted(count: int) -> str:
    return "1 passive motion" if count == 1 else f"{count} passive motions"


def _named(robot: ConstrainedModel, free: Floats) -> str:
    """Names and weights of the joints that take part in some motions: a joint that alone makes one up has a weight of 1."""
    weights = np.linalg.norm(free, axis=1)
    by_velocity = {int(v): joint for joint, v in enumerate(robot.model.idx_vs) if joint}
    joints: dict[str, float] = {}
    for velocity, weight in zip(np.arange(robot.model.nv)[robot.passive], weights, strict=True):
        first = max(v for v in by_velocity if v <= velocity)
        name = str(robot.model.names[by_velocity[first]])
        joints[name] = max(joints.get(name, 0.0), float(weight))
    named = sorted((name for name in joints if joints[name] >= NEGLIGIBLE), key=lambda name: -joints[name])
    more = f" and {len(named) - NAMED} more" if len(named) > NAMED else ""
    return ", ".join(f"{name} ({joints[name]:.2f})" for name in named[:NAMED]) + more
