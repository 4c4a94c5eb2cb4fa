"""Forward kinematics and derivatives of any robot, one closed posture after the other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.errors import ClosureError
from gtpin.kinematics.geometry_jacobian import geometry_jacobian
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.robot.geometry import Geometry
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ChainKinematics:
    """The kinematics of a robot without rods, computed by Pinocchio.

    Parameters
    ----------
    geometry
        Geometry whose parameters are deviations of joint placements.
    """

    geometry: Geometry

    @cached_property
    def robot(self) -> Robot:
        """The robot with its joints where the geometry puts them."""
        robot = self.geometry.robot
        return robot.with_placements(self.geometry.deviations("placement", "joint", (robot.model.njoints, 6)))

    def forward(self, q: Floats, start: Poses | None = None) -> Poses:
        """Poses at commands q (N, n), base frame; NaN where the loops can't be closed. ``start`` is not needed."""
        self.robot.check_commands(q)
        poses = Poses(np.full((len(q), 3), np.nan), np.full((len(q), 3, 3), np.nan))
        try:
            home_posture = self._home
        except ClosureError:
            if not np.any(self.geometry.deviation):
                raise  # not these commands are at fault but the URDF
            return poses
        for i, row in enumerate(q):
            try:
                posture = home_posture.moved_to(row)
            except ClosureError:
                continue
            poses.T[i], poses.R[i] = posture.T, posture.R
        return poses

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6, n) derivative of the TCP's pose by the commands; see ``RodKinematics``."""
        jacobians = [self._home.moved_to(row).jacobian for row in q]
        return np.array(jacobians).reshape(len(q), 6, self.robot.n_actuators)

    def geometry_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6, p) derivative of the TCP's pose by the geometry's parameters; see ``RodKinematics``."""
        jacobians = [geometry_jacobian(self._home.moved_to(row), self.geometry) for row in q]
        return np.array(jacobians).reshape(len(q), 6, len(self.geometry.parameters))

    @cached_property
    def _home(self) -> ClosedPosture:
        return home(self.robot)
