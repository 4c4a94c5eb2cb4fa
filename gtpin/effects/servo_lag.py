"""Servo lag: a deviation in proportion to the speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import Effect, Range, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import carts, number
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import modulated
from gtpin.robot.robot import Robot

FAST = 0.3
"""Speed, m/s or rad/s, that scales the modulation of the lag by the speed."""


class ServoLag(Effect):
    """dq = -tau speed: at the instant of measurement the actuator is behind its command by tau times its speed.

    dq is the deviation of the travel from the command, m (rad where the actuator turns). The speed is the actuator's, m/s or
    rad/s. The modulation: tau varies a little along the track and with the speed.

    Parameters: ``lag`` tau, s, positive where the actuator is behind its command.

    Typical size 0.2 ms. A position loop of gain Kv, about 10 to 100 / s, has a following error of speed / Kv (Mechanical
    Engineers' Handbook, vol. 2, Controller Design). It is a guess that velocity feed-forward leaves about a hundredth of it.
    """

    id = "servo_lag"
    title = "servo lag"
    clause = "{site} lags behind in proportion to its speed"
    remedy = "Measure at rest or slower; check position gain and velocity feed-forward."
    coefficient = ("lag", "s")
    of_travel = True
    between_visits = True
    core = (0,)
    usual: ClassVar[Mapping[str, Range]] = {
        "lag": Range(
            0.0, np.inf, "a drive ahead of its command has too much feed-forward, or the speed's sign is wrong"
        )
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The actuator's speed."""
        return (f"speed{number(robot, site)}",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Minus the speed, and its modulation by the speed itself and along the track."""
        j = at.robot.sites.index(site)
        speed = at.covariate(f"speed{number(at.robot, site)}")
        columns, size = modulated(-speed, [at.travel[:, j], speed / FAST], MODULATION.lag)
        return along_track(at, site, columns, unit(size, 2e-4))
