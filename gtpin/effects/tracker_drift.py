"""The measurement frame moves over time."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect
from gtpin.effects.frames import frame_twist
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines
from gtpin.robot.robot import Robot


class TrackerDrift(Effect):
    """The frame shifts and turns smoothly over time. Trackers on tripods: some 10 um and 10 urad an hour."""

    id = "tracker_drift"
    title = "the measurement frame moves over time"
    coefficient = ("shift_x", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """The measurement frame."""
        return ("frame",)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """Time."""
        return ("time",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Slow waves over time of all six freedoms of the frame; the constant is geometry's."""
        waves, size = cosines(np.clip(at.time, -1.5, 1.5), 1, 5, 1.5)
        twist, freedom = frame_twist(at)
        columns = np.concatenate([twist * wave[:, None, None] for wave in waves.T], axis=2)
        return Basis(np.concatenate([freedom * s for s in size]), twist=columns)
