"""Singularities of a robot: rank, condition number and weakest direction of its closures' and its actuators' Jacobians.

Where the closures' Jacobian of the passive joints loses rank, the loops let the robot move while the commands are fixed. Where
the actuators' Jacobian loses rank, some motion of the commands does not move the TCP. (Gosselin and Angeles, IEEE Transactions
on Robotics and Automation 6, 1990, call them singularities of the second and the first kind.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.errors import ModelError
from gtpin.kinematics.kinematics import nominal
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.kinematics.robot import Robot
from gtpin.real import real
from gtpin.robot.assembly import ZERO
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Ints

COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Regularity:
    """How regular a Jacobian is at N postures; of one posture, without the first index.

    - ``joints``: names of its c columns.
    - ``sizes``: (N, r) singular values, descending, m per m. Angles count as arcs of ``Singularities.length``.
    - ``rank``: (N,) number of singular values above 1e-7 of the largest.
    - ``condition``: (N,) largest singular value divided by the smallest; infinite where the rank is less than at most postures.
    - ``direction``: (N, c) unit vector of the joints' velocities, in m, that the Jacobian makes smallest: the ``condition`` is
      infinite because of it, or would be. Its largest component is positive.

    Where a posture is not reached, numbers are NaN and the rank is -1. Without columns, the condition number is 1.
    """

    joints: tuple[str, ...]
    sizes: Floats
    rank: Ints
    condition: Floats
    direction: Floats

    def weights(self, row: int = 0, least: float = 0.05) -> dict[str, float]:
        """The components of one posture's ``direction`` by joint, largest first, of at least a size of ``least``."""
        direction = np.atleast_2d(self.direction)[row]
        order = np.argsort(-np.abs(direction))
        return {self.joints[i]: float(direction[i]) for i in order if abs(direction[i]) >= least}


@dataclass(frozen=True)
class Singularities:
    """Of N postures, or of one: the regularity of two Jacobians.

    - ``closures``: of the closure equations by the passive joints, ``posture.constraint_jacobian[:, passive]``; motions that
      the loops never determine do not count.
    - ``actuators``: of the TCP's pose by the commands, ``posture.jacobian``.
    - ``length``: m; 1 rad counts as a motion of this length, of joints and of the TCP.
    """

    closures: Regularity
    actuators: Regularity
    length: float


def singularities(
    robot: Robot, at: npt.ArrayLike | ClosedPosture, frame: str | None = None, length: float | None = None
) -> Singularities:
    """Singularities at a posture, along a path, or over the workspace.

    Parameters
    ----------
    robot
        The robot.
    at
        (n,) commands, m or rad; (N, n) commands, of a path or of any set; or a :class:`ClosedPosture`, which may be singular.
    frame
        The frame that takes the place of the TCP: see :meth:`Robot.forward`.
    length
        Length that a rotation of 1 rad counts as, m; None: the root mean square distance of the moving joints from the TCP at
        home. It makes singular values comparable; a rank does not depend on it.

    Raises
    ------
    ModelError
        If the commands have another shape, there is no such frame, or the length is not positive.
    ClosureError
        If one command (n,) can't be reached. Of many, such rows are NaN: a singularity ends what can be reached from home.

    Examples
    --------
    >>> import numpy as np
    >>> import gtpin
    >>> ur5 = gtpin.load_robot("ur5")
    >>> found = gtpin.singularities(ur5, [0.0, -1.0, 1.5, 0.3, 0.0, 0.2])  # the wrist's axes 4 and 6 are parallel
    >>> int(found.actuators.rank), sorted(found.actuators.weights())
    (5, ['elbow_joint', 'shoulder_lift_joint', 'wrist_1_joint', 'wrist_3_joint'])
    """
    arc = _length(robot, frame) if length is None else float(length)
    if not (np.isfinite(arc) and arc > 0.0):
        raise ModelError(f"a length of {arc:g} m", hint="give a positive one")
    q, X = _postures(robot, at)
    names, turns = _velocities(robot)
    passive = robot.passive
    by_passive = np.full((len(q), 3 * len(robot.constraints), len(passive)), np.nan)
    by_commands = np.full((len(q), 6, robot.n_actuators), np.nan)
    for i in np.flatnonzero(np.isfinite(X).all(axis=1)):
        posture = ClosedPosture(robot, q[i], X[i], frame)
        D = posture.constraint_jacobian[:, passive]
        by_passive[i], by_passive[i, : len(D)] = 0.0, D
        by_commands[i] = posture.jacobian
    closures = _regularity([names[v] for v in passive], by_passive / np.where(turns[passive], arc, 1.0), robot.rank)
    by_commands = by_commands / np.where(robot.revolute, arc, 1.0) * np.repeat([1.0, arc], 3)[:, None]
    drives = [actuator.joint for actuator in robot.actuators]
    actuators = _regularity(drives, by_commands, min(6, len(drives)))
    if isinstance(at, ClosedPosture) or np.ndim(at) == 1:
        closures, actuators = (_first(found) for found in (closures, actuators))
    return Singularities(closures, actuators, arc)


def _postures(robot: Robot, at: npt.ArrayLike | ClosedPosture) -> tuple[Floats, Floats]:
    """Commands (N, n) and configurations (N, nq); NaN where they are not reached."""
    if isinstance(at, ClosedPosture):
        if at.robot is not robot:
            raise ModelError("the posture is another robot's", hint="give the robot that it is of")
        return at.q[None], at.configuration[None]
    q = real(at, f"commands for {robot.name}")
    if q.ndim != 2:
        return _postures(robot, robot.forward(q))
    X = nominal(robot).forward(q).configuration
    return q, robot.with_commands(robot.neutral, q) if X is None else X


def _regularity(joints: Sequence[str], J: Floats, most: int) -> Regularity:
    """Of Jacobians (N, r, c) whose rank is at most ``most``."""
    n, _, columns = J.shape
    sizes, direction = np.full((n, most), np.nan), np.full((n, columns), np.nan)
    known = np.isfinite(J).all(axis=(1, 2))
    condition = np.where(known, np.inf if most else 1.0, np.nan)
    rank = np.where(known, 0, -1)
    if most and known.any():
        _, found, rows = np.linalg.svd(J[known])
        sizes[known], weakest = found[:, :most], rows[:, most - 1]
        largest = np.take_along_axis(weakest, np.abs(weakest).argmax(axis=1)[:, None], axis=1)
        direction[known] = weakest * np.sign(largest)
        rank[known] = np.count_nonzero(found[:, :most] > ZERO * found[:, :1], axis=1)
        full = rank == most
        condition[full] = sizes[full, 0] / sizes[full, -1]
    return Regularity(tuple(joints), sizes, rank, condition, direction)


def _first(found: Regularity) -> Regularity:
    return Regularity(found.joints, found.sizes[0], found.rank[0], found.condition[0], found.direction[0])


def _velocities(robot: Chain) -> tuple[list[str], npt.NDArray[np.bool_]]:
    """Of each Pinocchio velocity the name, with its component (``pose.rx``) if a joint has several, and whether it turns."""
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, robot.neutral)
    names, turns = [""] * model.nv, np.zeros(model.nv, dtype=bool)
    for joint in range(1, model.njoints):
        own = np.reshape(pin.getJointJacobian(model, data, joint, pin.LOCAL), (6, model.nv))
        for v in range(int(model.idx_vs[joint]), int(model.idx_vs[joint]) + int(model.nvs[joint])):
            component = COMPONENTS[int(np.abs(own[:, v]).argmax())]
            names[v] = str(model.names[joint]) + (f".{component}" if model.nvs[joint] > 1 else "")
            turns[v] = bool(np.abs(own[3:, v]).max() > 0.5)
    return names, turns


def _length(robot: Robot, frame: str | None) -> float:
    """See ``length`` of :func:`singularities`; 1 m where all joints are at the TCP."""
    posture = home(robot).of(frame)
    at = np.array([posture.placement(joint).translation for joint in robot.moving_joints]).reshape(-1, 3)
    return float(np.sqrt(((at - posture.T) ** 2).sum(axis=1).mean())) or 1.0
