"""Shift of a drive's zero between sessions."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import drive_sizes
from gtpin.effects.effect import Effect
from gtpin.effects.sites import carts
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import session_columns
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


class ZeroShift(Effect):
    """dq = z(session); dq is the deviation of the travel from the command, m (rad where the actuator turns).

    The shift z is constant in each session, and positive where the actuator is farther than commanded. Geometry absorbs the
    mean over the sessions. In a prediction, a session that was not in the fit has the mean shift.

    Parameters: ``shift[k]``, m: z of session k less the mean over the sessions, which are sorted by name;
    ``largest_difference``, m, between two sessions. As a change since an earlier model: ``shift`` alone, m, of all poses.
    Where the actuator turns, rad replaces m.

    Typical size 40 um: a guess for the error of homing on a switch and a marker pulse. Without homing, the repeatability of
    the whole Gantry-Tau was 13 um in the mean and 50 um at most (Dressler et al. 2010, section I, after Crothers et al. 2009).
    """

    id = "zero_shift"
    title = "zero shift"
    clause = "the zero of {site} moved between sessions"
    first_checked = True
    remedy = "Check homing and reference switch; home again before each session."
    coefficient = ("shift", "m")
    of_travel = True
    since_a_model = True

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The session."""
        return ("session",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """One column for each session: a constant shift."""
        columns = session_columns(at)
        return along_track(at, site, columns, drive_sizes(at, site, np.ones(columns.shape[1]), 4e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Shift of each session, and the largest difference between two; ``shift`` alone since an earlier model."""
        if len(coefficients) == 1:
            return {"shift": (float(coefficients[0]), "m")}
        shifts = coefficients - coefficients.mean()
        found = {f"shift[{k + 1}]": (float(shift), "m") for k, shift in enumerate(shifts)}
        return {**found, "largest_difference": (float(np.ptp(shifts)), "m")}
