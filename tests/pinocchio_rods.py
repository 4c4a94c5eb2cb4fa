"""Robots with rods by Pinocchio, posture by posture: the same poses and derivatives as :class:`RodKinematics` in arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gtpin.errors import ClosureError
from gtpin.kinematics.geometry_jacobian import geometry_jacobian
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.kinematics.protocol import Bodies
from gtpin.kinematics.rod_geometry import Turned
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.robot.description import RobotDescription
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import rotation_axes
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


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
        jacobians = [geometry_jacobian(self._posture.moved_to(row), self._at_nominal) for row in q * self._travel_scale]
        own = np.array(jacobians).reshape(len(q), 6, len(self._at_nominal.parameters))
        return np.asarray(own @ self._chain)

    @cached_property
    def _posture(self) -> ClosedPosture:
        robot = self.geometry.robot
        return home(Robot(RobotDescription.parse(self.urdf(), source=robot.name), robot.tcp_frame))

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
                    found[row, column] = Turned(axes, turns[p.owner]).rate(p.component) @ moved[own.component]
                elif p.component == own.component:
                    found[row, column] = 1.0 / self._travel_scale[p.owner] if p.kind == "scale" else 1.0
        return found
