"""Motion of the TCP by displacements of joints and tool, pose by pose: from Pinocchio's regressors and constraint Jacobians."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from gtpin.errors import ClosureError
from gtpin.kinematics.geometry_jacobian import Regressors
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.kinematics.protocol import Bodies
from gtpin.robot.chain import joint_axis
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


def bodies(robot: Robot, q: Floats) -> Bodies:
    """Motion by placement frames at commands q (N, n); NaN where the loops can't be closed."""
    count = robot.model.njoints - 1
    response = _unknown(robot, q)
    R, T = np.full((len(q), count + 1, 3, 3), np.nan), np.full((len(q), count + 1, 3), np.nan)
    placed = _placed(robot)
    for i in _responses(robot, q, response):
        _frames(robot, placed, R[i], T[i])
    return Bodies(response, R, T)


def responses(robot: Robot, q: Floats, start: ClosedPosture | None = None) -> Floats:
    """The response of :class:`Bodies` alone, without the frames, in less time; ``start``: the home posture, if it is known."""
    response = _unknown(robot, q)
    for _ in _responses(robot, q, response, start):
        pass
    return response


def _unknown(robot: Robot, q: Floats) -> Floats:
    return np.full((len(q), robot.motion_size, robot.model.njoints + len(robot.anchors), 6), np.nan)


def index_of(joint_id: int) -> int:
    """Index of a Pinocchio joint in the arrays of :class:`Bodies`."""
    return joint_id - 1


def configurations(robot: Robot, q: Floats) -> Floats:
    """(N, nq) Pinocchio configurations of a robot without loops."""
    if robot.followers:
        return np.array([robot.with_commands(robot.neutral, row) for row in q]).reshape(len(q), robot.model.nq)
    found = np.tile(robot.neutral, (len(q), 1))
    for i, actuator in enumerate(robot.actuators):
        if robot.model.nqs[actuator.joint_id] == 2:
            found[:, actuator.index_q], found[:, actuator.index_q + 1] = np.cos(q[:, i]), np.sin(q[:, i])
        else:
            found[:, actuator.index_q] = q[:, i]
    return found


def driven_twists(robot: Robot) -> Floats:
    """(J + 1 + 2 L, 6, n) twist of each placement frame that is equivalent to a unit of each command; joints that follow are
    included."""
    twists = np.zeros((robot.model.njoints + len(robot.anchors), 6, robot.n_actuators))
    for i, actuator in enumerate(robot.actuators):
        twists[index_of(actuator.joint_id), :, i] = joint_axis(robot.model, actuator.joint_id)
    by_velocity = list(robot.model.idx_vs)
    for follower in robot.followers:
        if follower.master_v in robot.driven:
            joint_id = by_velocity.index(follower.index_v, 1)  # the universe, 0, has no velocity of its own
            own = follower.multiplier * joint_axis(robot.model, joint_id)
            twists[index_of(joint_id), :, robot.driven.index(follower.master_v)] = own
    return twists


def _responses(robot: Robot, q: Floats, response: Floats, start: ClosedPosture | None = None) -> Iterator[int]:
    """Fill in the response at one command after the other; Pinocchio's data hold the posture of the row that is yielded."""
    data, count = robot.data, robot.model.njoints - 1
    for i, by_joints in _loops(robot, q, start) if robot.constraints else _tree(robot, q):
        tcp = (data.oMi[robot.tcp_joint] * robot.tcp_placement).rotation
        response[i, :, :count] = by_joints[:, : 6 * count].reshape(robot.motion_size, count, 6)
        response[i, :, count] = 0.0
        response[i, :, count + 1 :] = by_joints[:, 6 * count :].reshape(robot.motion_size, -1, 6)
        response[i, :3, count, :3] = response[i, 3:6, count, 3:] = tcp
        yield i


def _tree(robot: Robot, q: Floats) -> Iterator[tuple[int, Floats]]:
    model, data, tcp = robot.model, robot.data, robot.tcp_placement
    for i, configuration in enumerate(configurations(robot, q)):
        pin.forwardKinematics(model, data, configuration)
        yield i, pin.computeJointKinematicRegressor(model, data, robot.tcp_joint, pin.LOCAL_WORLD_ALIGNED, tcp)


def _loops(robot: Robot, q: Floats, start: ClosedPosture | None) -> Iterator[tuple[int, Floats]]:
    start = home(robot) if start is None else start
    for i, row in enumerate(q):
        posture = _moved(start, row)
        if posture is not None:
            posture.refresh()
            regressors = Regressors(posture)
            joints = np.vstack([regressors.closed, regressors.measured])
            yield i, np.hstack([joints, regressors.by_anchors.reshape(len(joints), -1)])


def _moved(start: ClosedPosture, q: Floats) -> ClosedPosture | None:
    try:
        return start.moved_to(q)
    except ClosureError:
        return None


def _placed(robot: Robot) -> list[tuple[int, pin.SE3]]:
    """For each placement frame, and the TCP: the joint that carries it, and its placement on this joint."""
    model = robot.model
    joints = [(int(model.parents[j]), pin.SE3(model.jointPlacements[j])) for j in range(1, model.njoints)]
    return [*joints, (robot.tcp_joint, robot.tcp_placement)]


def _frames(robot: Robot, placed: list[tuple[int, pin.SE3]], R: Floats, T: Floats) -> None:
    """Placement frames of the posture that Pinocchio's data hold."""
    carriers = robot.data.oMi
    for index, (joint, placement) in enumerate(placed):
        frame = carriers[joint] * placement
        R[index], T[index] = frame.rotation, frame.translation
