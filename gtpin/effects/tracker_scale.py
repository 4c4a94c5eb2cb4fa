"""The instrument's length scale is off."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class TrackerScale(Effect):
    """dT = s (T - T_home): lengths are read too long where s > 0. About what point they grow is a shift, which geometry takes.

    Parameters: ``scale`` s, m/m.

    Typical size 3e-5. Air that is 1 K warmer than believed makes 1e-6 (its refractive index: Ciddor, Applied Optics 35,
    1996); a wrong scale bar, unit, or temperature of the part more.
    """

    id = "tracker_scale"
    title = "the instrument's length scale is off"
    coefficient = ("scale", "m/m")
    form = (0,)

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """The measurement frame."""
        return ("frame",)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it goes with."""
        return ("position",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Growth of the measured positions about home."""
        twist = np.zeros((len(at), 6, 1))
        twist[:, :3, 0] = at.poses.T - at.kinematics.home.T[0]
        return Basis(unit([1.0], 3e-5), twist=twist)
