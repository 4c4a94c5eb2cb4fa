"""Motion of the TCP by displaced joints, tool and anchors, from Pinocchio's regressors and constraint Jacobians."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from gtpin.errors import ClosureError
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.kinematics.protocol import Bodies
from gtpin.kinematics.rotations import skew
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import joint_axis
from gtpin.typing import Floats


def bodies(robot: Chain, q: Floats) -> Bodies:
    """Motion by placement frames at commands q (N, n); NaN where the loops can't be closed."""
    model, data = robot.model, robot.data
    placed = [(int(model.parents[j]), pin.SE3(model.jointPlacements[j])) for j in range(1, model.njoints)]
    placed.append((robot.tcp_joint, robot.tcp_placement))
    response = _unknown(robot, q)
    R, T = np.full((len(q), len(placed), 3, 3), np.nan), np.full((len(q), len(placed), 3), np.nan)
    for i in _responses(robot, q, response):
        for index, (joint, placement) in enumerate(placed):
            frame = data.oMi[joint] * placement
            R[i, index], T[i, index] = frame.rotation, frame.translation
    return Bodies(response, R, T)


def responses(robot: Chain, q: Floats, start: ClosedPosture | None = None) -> Floats:
    """The response of :class:`Bodies` alone, without the frames, in less time; ``start``: the home posture, if it is known."""
    response = _unknown(robot, q)
    for _ in _responses(robot, q, response, start):
        pass
    return response


def _unknown(robot: Chain, q: Floats) -> Floats:
    return np.full((len(q), robot.motion_size, robot.model.njoints + len(robot.anchors), 6), np.nan)


def index_of(joint_id: int) -> int:
    """Index of a Pinocchio joint in the arrays of :class:`Bodies`."""
    return joint_id - 1


def configurations(robot: Chain, q: Floats) -> Floats:
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


def driven_twists(robot: Chain) -> Floats:
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


def _responses(robot: Chain, q: Floats, response: Floats, start: ClosedPosture | None = None) -> Iterator[int]:
    """Fill in the response at one command after the other; Pinocchio's data hold the posture of the row that is yielded."""
    data, count = robot.data, robot.model.njoints - 1
    for i, by_frames in _loops(robot, q, start) if robot.constraints else _tree(robot, q):
        tcp = (data.oMi[robot.tcp_joint] * robot.tcp_placement).rotation
        response[i, :, :count] = by_frames[:, : 6 * count].reshape(robot.motion_size, count, 6)
        response[i, :, count] = 0.0
        response[i, :, count + 1 :] = by_frames[:, 6 * count :].reshape(robot.motion_size, -1, 6)
        response[i, :3, count, :3] = response[i, 3:6, count, 3:] = tcp
        yield i


def _tree(robot: Chain, q: Floats) -> Iterator[tuple[int, Floats]]:
    model, data, tcp = robot.model, robot.data, robot.tcp_placement
    for i, configuration in enumerate(configurations(robot, q)):
        pin.forwardKinematics(model, data, configuration)
        yield i, pin.computeJointKinematicRegressor(model, data, robot.tcp_joint, pin.LOCAL_WORLD_ALIGNED, tcp)


def _loops(robot: Chain, q: Floats, start: ClosedPosture | None) -> Iterator[tuple[int, Floats]]:
    start = home(robot) if start is None else start
    for i, row in enumerate(q):
        try:
            posture = start.moved_to(row)
        except ClosureError:
            continue
        yield i, by_frames(posture)


def by_frames(posture: ClosedPosture) -> Floats:
    """(6 + k, 6 (J + 2 L)) motion of the TCP, base frame, and of the k measured joints by twists (m, rad) of frames.

    The frames are those of J joints, in their own axes, and of the anchors of L loops, in the axes of their links: of an anchor
    only the translation moves anything, as the loop's joint is spherical. Passive joints close the loops again.
    """
    robot = posture.robot
    posture.refresh()
    tcp = _regressor(robot, robot.tcp_joint, robot.tcp_placement)
    gaps = np.zeros((3 * len(robot.constraints), tcp.shape[1]))
    for i, constraint in enumerate(robot.constraints):
        first = _regressor(robot, constraint.joint1_id, constraint.joint1_placement)
        second = _regressor(robot, constraint.joint2_id, constraint.joint2_placement)
        # The gap across a planar loop, where the joints have play, is not zero: it rotates with the first anchor.
        turning = -skew(robot.anchor_point(2 * i + 1) - robot.anchor_point(2 * i)) @ first[3:]
        gaps[3 * i : 3 * i + 3] = to_gap(robot, i, second[:3] - first[:3] - turning)
    gaps = robot.closing(gaps)
    passive = posture.passive_inverse[[joint.passive for joint in robot.measured_joints]]
    by_joints = np.vstack([tcp + posture.passive_response @ gaps, -passive @ gaps])
    by_gap = np.vstack([posture.passive_response, -passive])
    by_anchors = np.zeros((len(by_gap), len(robot.anchors), 6))
    for index, ((joint, _), axes) in enumerate(zip(robot.anchors, robot.anchor_axes, strict=True)):
        sign = 1.0 if index % 2 else -1.0  # the gap goes from the first anchor to the second
        gaps = np.zeros((3 * len(robot.constraints), 3))
        rows = slice(3 * (index // 2), 3 * (index // 2) + 3)
        gaps[rows] = to_gap(robot, index // 2, sign * robot.data.oMi[joint].rotation @ axes)
        by_anchors[:, index, :3] = by_gap @ robot.closing(gaps)
    return np.hstack([by_joints, by_anchors.reshape(len(by_gap), -1)])


def _regressor(robot: Chain, joint: int, placement: pin.SE3) -> Floats:
    """(6, 6 J) motion of a frame on a joint by twists of the joints' placements at constant coordinates; zero on the base."""
    if joint == 0:
        return np.zeros((6, 6 * (robot.model.njoints - 1)))
    found = pin.computeJointKinematicRegressor(robot.model, robot.data, joint, pin.LOCAL_WORLD_ALIGNED, placement)
    return np.array(found)


def to_gap(robot: Chain, loop: int, motion: Floats) -> Floats:
    """(3, ...) change of a loop's gap, in the first anchor's frame, by a motion (3, ...) of its second anchor, base frame.

    The gap is the vector from the loop's first anchor to its second, m, at the posture that the robot's ``data`` hold.
    """
    constraint = robot.constraints[loop]
    rotation = robot.data.oMi[constraint.joint1_id].rotation @ constraint.joint1_placement.rotation
    return np.asarray(rotation.T @ motion)
