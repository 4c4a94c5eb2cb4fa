"""Kinematics of robots with six rods whose poses and derivatives are the simulator's own, made without Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.bench.simulator.rods import Rods
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.motion import FrameMotion
from gtpin.kinematics.poses import Poses

Floats = np.ndarray


@dataclass(frozen=True)
class BySimulator(Kinematics):
    """Poses, and derivatives by commands and by parameters, are the simulator's; coordinates of joints are Pinocchio's."""

    calls: ClassVar[int] = 0

    def forward(self, q: Floats, start: Poses | None = None) -> Poses:
        """Poses at commands q (N, n), base frame; NaN where the loops can't be closed."""
        expected, found = super().forward(q, start), Rods(self.geometry).predict(q)
        np.testing.assert_array_equal(found.reached, expected.reached)
        BySimulator.calls += 1
        return Poses(found.T, found.R, expected.joints, expected.configuration)

    def command_jacobian(self, q: Floats, poses: Poses, at: FrameMotion | None = None) -> Floats:
        """(N, 6, n) derivative of the TCP's pose by the commands."""
        return Rods(self.geometry).command_jacobian(q, VirtualPoses(poses.T, poses.R))

    def geometry_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6, p) derivative of the TCP's pose by the geometry's parameters."""
        rods = Rods(self.geometry)
        return rods.answer(q, VirtualPoses(poses.T, poses.R), rods.changed(q))
