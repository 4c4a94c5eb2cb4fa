"""The measurement frame sits elsewhere in each session."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect, Floats
from gtpin.effects.frames import FREEDOMS, frame_twist
from gtpin.effects.sessions import session_columns
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class FrameShift(Effect):
    """dT = s + w x (T - T_home), dR = w, s and w constant in each session, as after the tracker was set up again.

    s, m, and w, rad, are in the base frame, about the TCP at home; positive where what is seen moves towards the positive
    axis. The sessions' mean is geometry. A session that the fit has not seen has the mean shift.

    Parameters: ``shift_x[k]``, ``shift_y[k]``, ``shift_z[k]``, m, and ``turn_x[k]``, ``turn_y[k]``, ``turn_z[k]``, rad, of the
    k-th session in the order of their names, less the mean.

    Typical size 40 um and 15 urad: a network of some reference marks, each of them known to 15 um + 6 um/m across the line
    of sight (Leica Absolute Tracker, user's manual, after ISO 10360-10).
    """

    id = "frame_shift"
    title = "the measurement frame sits elsewhere in each session"
    clause = "{site} sits elsewhere in each session"
    remedy = "A fault of the measurement: tie the sessions together by reference nests."
    coefficient = ("shift_x[1]", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """The measurement frame."""
        return ("frame",)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The session."""
        return ("session",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """All six freedoms of the frame for each session."""
        twist, freedom = frame_twist(at)
        sessions = session_columns(at)
        columns = np.concatenate([twist * member[:, None, None] for member in sessions.T], axis=2)
        return Basis(np.tile(freedom, sessions.shape[1]), twist=columns)

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Shifts and turns of each session."""
        by_session = coefficients.reshape(-1, 6)
        return {
            f"{name}[{k + 1}]": (float(value), unit)
            for k, values in enumerate(by_session - by_session.mean(axis=0))
            for (name, unit), value in zip(FREEDOMS, values, strict=True)
        }
