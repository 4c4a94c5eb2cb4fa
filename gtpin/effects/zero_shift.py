"""The zero of a drive moved between sessions."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import Effect, carts, unit
from gtpin.effects.sessions import session_columns
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class ZeroShift(Effect):
    """dq = z(session), about the sessions' mean."""

    id = "zero_shift"
    title = "zero of the drive moved between sessions"
    coefficient = ("shift", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The session."""
        return ("session",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """One shift for each session."""
        columns = session_columns(at)
        return along_track(at, site, columns, unit(np.ones(columns.shape[1]), 4e-5))
