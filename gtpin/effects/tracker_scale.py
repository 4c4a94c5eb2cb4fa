"""Scale error of the instrument: measured lengths are wrong by a constant factor."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect
from gtpin.effects.modulation import MODULATION
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot

SCALE = 3e-5
"""Typical size of the scale error, m/m."""


class TrackerScale(Effect):
    """dT = s (T - T_home): measured lengths are too long where s > 0. T is the TCP position, T_home that at home, m.

    Another centre of the scaling only adds a constant shift, which geometry absorbs. Where the scale varies with time or with
    the temperature of the air, all measured positions also shift along the line of sight. The instrument's position is not
    used, so the shift can have any direction.

    Parameters: ``scale`` s, m/m.

    Typical size 3e-5. Air that is 1 K warmer than assumed causes 1e-6 (its refractive index: Ciddor, Applied Optics 35,
    1996). A wrong scale bar, unit or part temperature causes more.
    """

    id = "tracker_scale"
    title = "wrong length scale"
    clause = "the instrument's length scale is off"
    remedy = "A fault of the measurement: check the tracker's weather station and its scale on a calibrated bar."
    coefficient = ("scale", "m/m")
    stretches_frame = True
    core = (0,)

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """The measurement frame."""
        return ("frame",)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The position of the TCP."""
        return ("position",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Scaling of the measured positions about home, and shifts where the scale varies with time or temperature."""
        waves = []
        if at.has("time"):
            t = np.clip(at.time, -1.0, 1.0)
            waves += [np.cos(np.pi / 2.0 * k * (t + 1.0)) / k for k in (1, 2, 3)]
        if at.has("temp_frame"):
            waves.append((at.covariate("temp_frame") - at.references.temperature) / 3.0)
        twist = np.zeros((len(at), 6, 1 + 3 * len(waves)))
        twist[:, :3, 0] = at.poses.T - at.kinematics.home.T[0]
        for k, wave in enumerate(waves):
            twist[:, :3, 1 + 3 * k : 4 + 3 * k] = np.eye(3) * wave[:, None, None]
        return Basis(np.concatenate([[SCALE], np.full(3 * len(waves), SCALE * MODULATION.wander)]), twist=twist)
