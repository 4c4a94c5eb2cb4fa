"""Robots with rods by Pinocchio, posture by posture: the same poses and derivatives as :class:`RodKinematics` in arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from gtpin.errors import ClosureError
from gtpin.kinematics.bodies import by_frames, to_gap
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.kinematics.protocol import Bodies
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.kinematics.rotations import left_jacobian
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import Parameter, rotation_axes
from gtpin.typing import Floats


def rods_jacobian(posture: ClosedPosture, geometry: Geometry) -> Floats:
    """(6, p) derivative of a posture by the geometry of its own URDF, from Pinocchio's regressor and constraint Jacobians.

    A parameter displaces joints or loop anchors; the passive coordinates close the loops again.
    """
    closed = by_frames(posture)
    return np.array([_column(posture, closed, p) for p in geometry.parameters]).reshape(-1, 6).T


def _column(posture: ClosedPosture, closed: Floats, p: Parameter) -> Floats:
    """(6,) motion of the TCP by one parameter; ``closed``: that by twists of the joints' placements, in their own frames."""
    robot = posture.robot

    def twisted(joint: int, shift: Floats, turn: Floats) -> Floats:
        back = robot.model.jointPlacements[joint].rotation.T
        return closed[:6, 6 * (joint - 1) : 6 * joint] @ np.concatenate([back @ shift, back @ turn])

    def seated(i: int, motion: Floats) -> Floats:
        """By a motion (3,) of a rod's joint on its carrier, base frame, m."""
        rod = robot.rods[i]
        sign = 1.0 if rod.rod_end == 0 else -1.0
        rows = slice(3 * rod.loop, 3 * rod.loop + 3)
        return posture.passive_response[:, rows] @ (sign * to_gap(robot, rod.loop, motion))

    def at_zero(i: int, motion: Floats) -> Floats:
        """A motion (3,), base frame, of a rod's joint at the command 0, as its carrier has turned it since."""
        carrier = robot.rods[i].carrier
        if carrier is None or not robot.actuators[carrier].revolute:
            return motion
        return pin.exp3(robot.actuators[carrier].axis * posture.q[carrier]) @ motion

    if p.kind == "scale" and p.per == "actuator":
        return posture.jacobian[:, p.owner] * posture.q[p.owner]
    if p.kind == "direction":
        carrier = p.owner if p.per == "actuator" else robot.rods[p.owner].carrier
        actuator = robot.actuators[carrier]
        turn = rotation_axes(actuator.axis)[p.component]
        if p.per == "rod":  # only this rod's carrier joint leaves the common track
            motion = np.cross(turn, robot.anchor_point(robot.rods[p.owner].seat) - actuator.origin)
            return seated(p.owner, motion - at_zero(p.owner, np.cross(turn, robot.rods[p.owner].C - actuator.origin)))
        # The joint's placement rotates, and the carrier joints rotate back to their places at the command 0.
        moved = [i for i, rod in enumerate(robot.rods) if rod.carrier == carrier]
        back = [seated(i, at_zero(i, np.cross(turn, robot.rods[i].C - actuator.origin))) for i in moved]
        return twisted(actuator.joint_id, np.zeros(3), turn) - sum(back)
    rod = robot.rods[p.owner]
    if p.kind == "length":
        along = robot.anchor_point(rod.tip) - robot.data.oMi[rod.joint_id].translation
        # A longer rod moves its own end: the gap changes with the opposite sign to that of a motion of the carrier joint.
        return -seated(p.owner, along / np.linalg.norm(along))
    if p.kind == "platform_joint":
        return twisted(rod.joint_id, robot.tcp_placement.rotation[:, p.component], np.zeros(3))
    if p.kind == "carrier_joint":
        return seated(p.owner, at_zero(p.owner, np.eye(3)[p.component]))
    rows = slice(3 * rod.loop, 3 * rod.loop + 3)  # the scale of one rod's drive
    gap = posture.constraint_jacobian[rows, robot.actuators[rod.driver].index_v] * posture.q[rod.driver]
    return posture.passive_response[:, rows] @ gap


@dataclass(frozen=True)
class PinocchioRods(RodKinematics):
    """The kinematics of a robot with rods, computed by Pinocchio from a URDF that is written with the geometry.

    Drive scales, which a URDF can't hold, multiply the commands. Other parts that a URDF can't represent are not allowed.
    """

    def forward(self, q: Floats, start: Poses | None = None) -> Poses:
        """Poses at commands q (N, n), base frame; NaN where the loops can't be closed. ``start`` is not needed."""
        self.geometry.robot.check_commands(q)
        poses = Poses(np.full((len(q), 3), np.nan), np.full((len(q), 3, 3), np.nan))
        for i, row in enumerate(q * self._travel_scale):
            try:
                posture = self._posture.moved_to(row)
            except ClosureError:
                continue
            poses.T[i], poses.R[i] = posture.T, posture.R
        return poses

    def command_jacobian(self, q: Floats, poses: Poses, at: Bodies | None = None) -> Floats:
        """(N, 6, n) derivative of the TCP's pose by the commands; see ``RodKinematics``."""
        jacobians = [self._posture.moved_to(row).jacobian * self._travel_scale for row in q * self._travel_scale]
        return np.array(jacobians).reshape(len(q), 6, -1)

    def geometry_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6, p) derivative of the TCP's pose by the geometry's parameters; see ``RodKinematics``."""
        jacobians = [rods_jacobian(self._posture.moved_to(row), self._at_nominal) for row in q * self._travel_scale]
        own = np.array(jacobians).reshape(len(q), 6, len(self._at_nominal.parameters))
        return np.asarray(own @ self._chain)

    @cached_property
    def _posture(self) -> ClosedPosture:
        robot = self.geometry.robot
        return home(Chain(RobotDescription.parse(self.urdf(), source=robot.name), robot.tcp_frame))

    @cached_property
    def _travel_scale(self) -> Floats:
        """(n,) travel per commanded unit."""
        count = self.geometry.robot.n_actuators
        return np.asarray(1.0 + self.geometry.deviations("scale", "actuator", (count, 1))[:, 0])

    @cached_property
    def _at_nominal(self) -> Geometry:
        """The parameters of the robot of the written URDF, at its own nominal values. A direction has both a and b."""
        found = {}
        for p in self.geometry.parameters:
            for one in (replace(p, component=0), replace(p, component=1)) if p.kind == "direction" else (p,):
                found[one.kind, one.per, one.owner, one.component] = one
        return Geometry(self._posture.robot, tuple(found.values()), np.array([p.nominal for p in found.values()]))

    @cached_property
    def _chain(self) -> Floats:
        """(p', p) derivative of the p' parameters of the written URDF's robot by the p parameters of the geometry.

        They differ in directions and scales, which are relative to the axes and the travel of their own robot.
        """
        found = np.zeros((len(self._at_nominal.parameters), len(self.geometry.parameters)))
        count = self.geometry.robot.n_actuators
        turns = self.geometry.deviations("direction", "actuator", (count, 3))
        for column, p in enumerate(self.geometry.parameters):
            for row, own in enumerate(self._at_nominal.parameters):
                if (p.kind, p.per, p.owner) != (own.kind, own.per, own.owner):
                    continue
                if p.kind == "direction":
                    axes = rotation_axes(self.geometry.robot.actuators[p.owner].axis)
                    moved = rotation_axes(self._posture.robot.actuators[p.owner].axis)
                    found[row, column] = left_jacobian(turns[p.owner] @ axes) @ axes[p.component] @ moved[own.component]
                elif p.component == own.component:
                    found[row, column] = 1.0 / self._travel_scale[p.owner] if p.kind == "scale" else 1.0
        return found
