"""The measurement frame sits elsewhere in each session."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect
from gtpin.effects.frames import frame_twist
from gtpin.effects.sessions import session_columns
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class FrameShift(Effect):
    """The frame is shifted and turned by a constant in each session, as after the tracker was set up again."""

    id = "frame_shift"
    title = "the measurement frame sits elsewhere in each session"
    coefficient = ("shift_x", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """The measurement frame."""
        return ("frame",)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The session."""
        return ("session",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """All six freedoms of the frame for each session."""
        twist, freedom = frame_twist(at)
        sessions = session_columns(at)
        columns = np.concatenate([twist * member[:, None, None] for member in sessions.T], axis=2)
        return Basis(np.tile(freedom, sessions.shape[1]), twist=columns)
