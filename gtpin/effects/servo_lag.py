"""Deviation that grows with speed."""

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
"""Speed, m/s, over which the lag may vary."""


class ServoLag(Effect):
    """dq = -tau speed: at the instant of measurement the actuator is behind its command by tau times its speed.

    Parameters: ``lag`` tau, s, positive where it stays behind.

    Typical size 0.2 ms. A position loop of gain Kv, some 10 to 100 / s, follows with an error of speed / Kv (Mechanical
    Engineers' Handbook, vol. 2, Controller Design); that velocity feed-forward leaves about a hundredth of it is a guess.
    """

    id = "servo_lag"
    title = "deviation that grows with speed"
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
