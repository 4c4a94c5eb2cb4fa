"""The measurement frame has another pose in each session."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import FREEDOMS, frame_twist, session_columns
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


class FrameShift(Effect):
    """dT = s + w x (T - T_home), dR = w: the measured poses shift and rotate by a constant amount in each session.

    T is the measured TCP position, T_home that at home, m; dR is a rotation vector. The shift s, m, and the rotation vector
    w, rad, are in the base frame. s is positive where the measured positions move towards the positive axis, w is
    right-handed. A cause is an instrument that was set up again. Geometry absorbs the mean over the sessions. In a prediction,
    a session that was not in the fit has the mean shift.

    Parameters: ``shift_x[k]``, ``shift_y[k]``, ``shift_z[k]``, m, and ``turn_x[k]``, ``turn_y[k]``, ``turn_z[k]``, rad: s and w
    of session k less their means over the sessions. Sessions are sorted by name. As a change since an earlier model:
    ``shift_x`` and so on, of all poses.

    Typical size 40 um and 15 urad. This is assumed for a network of a few reference marks, each known to 15 um + 6 um/m
    across the line of sight (Leica Absolute Tracker, user's manual, after ISO 10360-10).
    """

    id = "frame_shift"
    title = "shift between sessions"
    clause = "{site} has another pose in each session"
    since_a_model = True
    remedy = "A fault of the measurement: tie the sessions together by reference nests."
    coefficient = ("shift_x[1]", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """The measurement frame."""
        return ("frame",)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The session."""
        return ("session",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """The six degrees of freedom of the frame, for each session."""
        twist, freedom = frame_twist(at)
        sessions = session_columns(at)
        columns = np.concatenate([twist * member[:, None, None] for member in sessions.T], axis=2)
        return Basis(np.tile(freedom, sessions.shape[1]), twist=columns)

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Shifts and turns of the frame in each session, less their means over the sessions."""
        by_session = coefficients.reshape(-1, 6)
        if len(by_session) == 1:
            return {name: (float(value), unit) for (name, unit), value in zip(FREEDOMS, by_session[0], strict=True)}
        return {
            f"{name}[{k + 1}]": (float(value), unit)
            for k, values in enumerate(by_session - by_session.mean(axis=0))
            for (name, unit), value in zip(FREEDOMS, values, strict=True)
        }
