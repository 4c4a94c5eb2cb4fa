"""Derivative of a closed posture by the geometry, from Pinocchio's kinematic regressor and constraint Jacobians."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from gtpin.errors import ModelError
from gtpin.kinematics.posture import ClosedPosture
from gtpin.kinematics.rotations import skew, twist_jacobian
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import Parameter, rotation_axes
from gtpin.typing import Floats


def geometry_jacobian(posture: ClosedPosture, geometry: Geometry) -> Floats:
    """(6, p) derivative of the TCP's pose by geometric parameters: position (m) and rotation vector (rad), base frame.

    A parameter displaces joints or loop anchors. Pinocchio's ``computeJointKinematicRegressor`` gives the motion of the TCP
    at constant joint coordinates. The motion by the passive coordinates, which close the loops again, is added.

    Parameters
    ----------
    posture
        A posture of the robot whose URDF has this geometry.
    geometry
        Its p parameters. For a robot with rods their values must be nominal.

    Raises
    ------
    ModelError
        If the geometry is not that of the posture's robot, or has shared rod lengths or measured tracks, which a URDF can't
        have.

    Examples
    --------
    >>> import gtpin
    >>> robot = gtpin.load_robot("gantry_tau")
    >>> gtpin.geometry_jacobian(gtpin.home(robot), gtpin.Geometry.nominal(robot)).shape
    (6, 48)
    """
    robot = posture.robot
    if robot.description.xml != geometry.robot.description.xml or robot.tcp_frame != geometry.robot.tcp_frame:
        raise ModelError("the geometry is another robot's", hint="load both from one URDF")
    if robot.rods and np.any(geometry.deviation != 0.0):
        raise ModelError("the posture is not of this geometry", hint="load the calibrated URDF and move its home there")
    if geometry.reduced or any(track is not None for track in geometry.tracks):
        raise ModelError(
            "shared rods and measured tracks are not in the URDF", hint="use RodKinematics.geometry_jacobian"
        )
    posture.refresh()
    regressors = Regressors(posture)
    columns = [_KINDS[p.kind](posture, regressors, geometry, p) for p in geometry.parameters]
    jacobian = np.array(columns).reshape(-1, 6).T
    jacobian.flags.writeable = False
    return jacobian


class Regressors:
    """Motion of the TCP and of measured joints by twists of joint placements.

    A loop's *gap* is the vector from its first anchor to its second, m, in the frame of the first.

    Attributes
    ----------
    tcp, closed
        (6, 6 J) motion of the TCP, base frame, by twists of the J joints in their own axes: at constant joint coordinates, and
        with passive joints that close the loops again.
    measured
        (k, 6 J) motion of the coordinates of the k measured joints, rad or m, with closed loops.
    """

    def __init__(self, posture: ClosedPosture) -> None:
        robot = posture.robot
        self.tcp = self._regressor(posture, robot.tcp_joint, robot.tcp_placement)
        gaps = np.zeros((3 * len(robot.constraints), self.tcp.shape[1]))
        for i, constraint in enumerate(robot.constraints):
            first = self._regressor(posture, constraint.joint1_id, constraint.joint1_placement)
            second = self._regressor(posture, constraint.joint2_id, constraint.joint2_placement)
            # The gap across a planar loop, where the joints have play, is not zero: it rotates with the first anchor.
            turning = -skew(_gap(posture, i)) @ first[3:]
            gaps[3 * i : 3 * i + 3] = to_gap(posture, i, second[:3] - first[:3] - turning)
        gaps = robot.closing(gaps)
        self.closed: Floats = self.tcp + posture.passive_response @ gaps
        rows = [joint.passive for joint in robot.measured_joints]
        self.measured: Floats = -posture.passive_inverse[rows] @ gaps
        self._by_gap = np.vstack([posture.passive_response, -posture.passive_inverse[rows]])
        self._posture = posture

    @property
    def by_anchors(self) -> Floats:
        """(6 + k, 2 L, 6) motion of the TCP and the k measured joints by a twist of each anchor of L loops.

        A twist is in the axes of the anchor's link, m and rad. Only its translation moves anything: the loop's joint is
        spherical.
        """
        posture, robot = self._posture, self._posture.robot
        found = np.zeros((len(self._by_gap), len(robot.anchors), 6))
        for index, ((joint, _), axes) in enumerate(zip(robot.anchors, robot.anchor_axes, strict=True)):
            sign = 1.0 if index % 2 else -1.0  # the gap goes from the first anchor to the second
            gaps = np.zeros((3 * len(robot.constraints), 3))
            rows = slice(3 * (index // 2), 3 * (index // 2) + 3)
            gaps[rows] = to_gap(posture, index // 2, sign * robot.data.oMi[joint].rotation @ axes)
            found[:, index, :3] = self._by_gap @ robot.closing(gaps)
        return found

    @staticmethod
    def _regressor(posture: ClosedPosture, joint: int, placement: object) -> Floats:
        robot = posture.robot
        if joint == 0:
            return np.zeros((6, 6 * (robot.model.njoints - 1)))
        return np.array(
            pin.computeJointKinematicRegressor(robot.model, robot.data, joint, pin.LOCAL_WORLD_ALIGNED, placement)
        )

    def twist(self, joint: int, twist: Floats) -> Floats:
        """(6,) motion of the TCP by a twist (6,) of a joint's placement, in the placement's own frame."""
        return np.asarray(self.closed[:, 6 * (joint - 1) : 6 * joint] @ twist)


def _gap(posture: ClosedPosture, loop: int) -> Floats:
    """(3,) from a loop's first anchor to its second, base frame, m."""
    return posture.robot.anchor_point(2 * loop + 1) - posture.robot.anchor_point(2 * loop)


def to_gap(posture: ClosedPosture, loop: int, motion: Floats) -> Floats:
    """(3, ...) change of a loop's gap, in the first anchor's frame, by a motion (3, ...) of its second anchor, base frame."""
    constraint = posture.robot.constraints[loop]
    rotation = posture.robot.data.oMi[constraint.joint1_id].rotation @ constraint.joint1_placement.rotation
    return np.asarray(rotation.T @ motion)


def _seat(posture: ClosedPosture, rod_index: int, motion: Floats) -> Floats:
    """(6,) motion of the TCP by a motion (3,) of a rod's joint on its carrier, base frame, m."""
    rod = posture.robot.rods[rod_index]
    sign = 1.0 if rod.rod_end == 0 else -1.0
    rows = slice(3 * rod.loop, 3 * rod.loop + 3)
    return posture.passive_response[:, rows] @ (sign * to_gap(posture, rod.loop, motion))


def _length(posture: ClosedPosture, _: Regressors, __: Geometry, p: Parameter) -> Floats:
    robot = posture.robot
    rod = robot.rods[p.owner]
    along = robot.anchor_point(rod.tip) - robot.data.oMi[rod.joint_id].translation
    # A longer rod moves its own end: the gap changes with the opposite sign to that of a motion of the carrier joint.
    return -_seat(posture, p.owner, along / np.linalg.norm(along))


def _platform_joint(posture: ClosedPosture, regressors: Regressors, _: Geometry, p: Parameter) -> Floats:
    robot = posture.robot
    rod = robot.rods[p.owner]
    placement = robot.model.jointPlacements[rod.joint_id]
    axis = placement.rotation.T @ robot.tcp_placement.rotation @ np.eye(3)[p.component]
    return regressors.twist(rod.joint_id, np.concatenate([axis, np.zeros(3)]))


def _at_zero(posture: ClosedPosture, rod_index: int) -> Floats:
    """(3, 3) rotation, base frame, of a rod's carrier from its orientation at the command 0."""
    robot = posture.robot
    carrier = robot.rods[rod_index].carrier
    if carrier is None or not robot.actuators[carrier].revolute:
        return np.eye(3)
    return np.asarray(pin.exp3(robot.actuators[carrier].axis * posture.q[carrier]))


def _carrier_joint(posture: ClosedPosture, _: Regressors, __: Geometry, p: Parameter) -> Floats:
    return _seat(posture, p.owner, _at_zero(posture, p.owner)[:, p.component])


def _direction(posture: ClosedPosture, regressors: Regressors, geometry: Geometry, p: Parameter) -> Floats:
    robot = posture.robot
    if p.per == "rod":
        moved = [p.owner]
        carrier = robot.rods[p.owner].carrier
    else:
        moved = [i for i, rod in enumerate(robot.rods) if rod.carrier == p.owner]
        carrier = p.owner
    assert carrier is not None
    actuator = robot.actuators[carrier]
    turn = rotation_axes(actuator.axis)[p.component]
    if p.per == "rod":  # only this rod's carrier joint leaves the common track
        motion = np.cross(turn, robot.anchor_point(robot.rods[p.owner].seat) - actuator.origin)
        motion -= _at_zero(posture, p.owner) @ np.cross(turn, robot.rods[p.owner].C - actuator.origin)
        return _seat(posture, p.owner, motion)
    # The joint's placement rotates, and the carrier joints rotate back to their places at the command 0.
    placement = robot.model.jointPlacements[actuator.joint_id]
    result = regressors.twist(actuator.joint_id, np.concatenate([np.zeros(3), placement.rotation.T @ turn]))
    for i in moved:
        back = _at_zero(posture, i) @ np.cross(turn, robot.rods[i].C - actuator.origin)
        result = result - _seat(posture, i, back)
    return result


def _scale(posture: ClosedPosture, _: Regressors, __: Geometry, p: Parameter) -> Floats:
    robot = posture.robot
    if p.per == "actuator":
        return np.asarray(posture.jacobian[:, p.owner] * posture.q[p.owner])
    rod = robot.rods[p.owner]
    driver = rod.driver
    assert driver is not None
    velocity = robot.actuators[driver].index_v
    rows = slice(3 * rod.loop, 3 * rod.loop + 3)
    gap = posture.constraint_jacobian[rows, velocity] * posture.q[driver]
    return np.asarray(posture.passive_response[:, rows] @ gap)


def _platform(posture: ClosedPosture, _: Regressors, geometry: Geometry, p: Parameter) -> Floats:
    twist = twist_jacobian(geometry.platform)[:, p.component]
    return np.concatenate([posture.R @ twist[:3], posture.R @ twist[3:]])


def _placement(posture: ClosedPosture, regressors: Regressors, geometry: Geometry, p: Parameter) -> Floats:
    twist = geometry.deviations("placement", "joint", (posture.robot.model.njoints, 6))[p.owner]
    return regressors.twist(p.owner, twist_jacobian(twist)[:, p.component])


def _anchor(_: ClosedPosture, regressors: Regressors, __: Geometry, p: Parameter) -> Floats:
    return regressors.by_anchors[:6, p.owner, p.component]


_KINDS: dict[str, Callable[[ClosedPosture, Regressors, Geometry, Parameter], Floats]] = {
    "length": _length,
    "platform_joint": _platform_joint,
    "carrier_joint": _carrier_joint,
    "direction": _direction,
    "scale": _scale,
    "placement": _placement,
    "platform": _platform,
    "anchor": _anchor,
}
