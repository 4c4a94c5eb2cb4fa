"""The measurement frame moves over time."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import FREEDOMS, cosines, frame_twist, span
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

ORDERS, DECAY = 8, 1.3
"""Number of cosines over the time of the fit for each degree of freedom of the frame, and the power p: the size of order k is
proportional to k^-p."""


class TrackerDrift(Effect):
    """dT = s(t) + w(t) x (T - T_home), dR = w(t): all measured poses shift and rotate smoothly with time.

    T is the TCP position, m, T_home that at home; dR is a rotation vector. The shift s, m, and the rotation vector w, rad, are
    in the base frame; s is positive where the measured positions move towards the positive axis, w is right-handed. The
    constant part of s and w is left out, because geometry absorbs it. Outside the time range of the fit the drift is constant.

    Parameters: ``shift_x``, ``_y``, ``_z``, m, and ``turn_x``, ``_y``, ``_z``, rad: s and w at the end of the fit's time
    range less at its beginning; ``largest_shift``, m, and ``largest_turn``, rad: the largest difference between two times,
    over the three axes.

    Typical size 40 um and 15 urad. Across its line of sight a laser tracker may have an error of 15 um + 6 um/m (Leica
    Absolute Tracker, user's manual, after ISO 10360-10). That a tripod moves by as much while the room warms up is a guess.
    """

    id = "tracker_drift"
    title = "drift over time"
    clause = "{site} drifts over time"
    remedy = "A fault of the measurement: check the tracker's stand and warm-up; measure reference nests in between."
    coefficient = ("shift_x", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """The measurement frame."""
        return ("frame",)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """Time."""
        return ("time",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Cosines over time for the six degrees of freedom of the frame, without the constant, which geometry absorbs."""
        waves, size = cosines(np.clip(at.time, -1.0, 1.0), 1, ORDERS, DECAY)
        twist, freedom = frame_twist(at)
        columns = np.concatenate([twist * wave[:, None, None] for wave in waves.T], axis=2)
        return Basis(np.concatenate([freedom * s for s in size]), twist=columns)

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """The drift from beginning to end, and the largest difference between two times."""
        by_order = coefficients.reshape(-1, 6)
        drift = -2.0 * by_order[::2].sum(axis=0)
        spans = [span(c) for c in by_order.T]
        return {
            **{name: (float(d), unit) for (name, unit), d in zip(FREEDOMS, drift, strict=True)},
            "largest_shift": (max(spans[:3]), "m"),
            "largest_turn": (max(spans[3:]), "rad"),
        }
