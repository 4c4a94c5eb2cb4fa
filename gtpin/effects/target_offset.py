"""The target is not where the TCP is believed to be."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class TargetOffset(Effect):
    """dT = R p. Geometry can move all joints on the platform instead, which takes nearly all of it."""

    id = "target_offset"
    title = "the target is not where the TCP is believed to be"
    coefficient = ("offset_x", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """The platform."""
        return ("platform",)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it goes with."""
        return ("position",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Offsets along the TCP frame's axes."""
        twist = np.zeros((len(at), 6, 3))
        twist[:, :3] = at.poses.R
        return Basis(unit(np.ones(3), 1e-3), twist=twist)
