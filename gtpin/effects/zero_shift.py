"""The zero of a drive moved between sessions."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import drive_sizes
from gtpin.effects.effect import Effect, Floats
from gtpin.effects.sessions import session_columns
from gtpin.effects.sites import carts
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class ZeroShift(Effect):
    """dq = z(session): in a session the actuator is farther along by z than commanded, about the sessions' mean.

    The mean itself is geometry. A session that the fit has not seen has the mean shift.

    Parameters: ``shift[k]``, m (rad of an arm), of the k-th session in the order of their names, less the mean;
    ``largest_difference`` between two sessions, m.

    Typical size 40 um: a guess for what homing on a switch and a marker pulse leaves. The whole Gantry-Tau repeated to 13 um
    in the mean and 50 um at most, without homing in between (Dressler et al. 2010, section I, after Crothers et al. 2009).
    """

    id = "zero_shift"
    title = "zero of the drive moved between sessions"
    clause = "the zero of {site} moved between sessions"
    remedy = "Check homing and reference switch; home again before each session."
    coefficient = ("shift", "m")
    of_travel = True

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The session."""
        return ("session",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """One shift for each session."""
        columns = session_columns(at)
        return along_track(at, site, columns, drive_sizes(at, site, np.ones(columns.shape[1]), 4e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Shift of each session, and the largest difference between two."""
        shifts = coefficients - coefficients.mean()
        found = {f"shift[{k + 1}]": (float(shift), "m") for k, shift in enumerate(shifts)}
        return {**found, "largest_difference": (float(np.ptp(shifts)), "m")}
