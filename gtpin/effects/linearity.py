"""Smooth deviation along a track (ISO 230-1: EXX)."""

from __future__ import annotations

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import Effect, carts, unit
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines
from gtpin.robot.robot import Robot


class Linearity(Effect):
    """dq = f(q), smooth. Cart 2 of the paper departed from a straight line by 25 to 140 um."""

    id = "linearity"
    title = "smooth deviation along the track (EXX)"
    coefficient = ("first_wave", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Cosines along the track, the slower the larger; the first stands for the slope that geometry leaves."""
        j = at.robot.sites.index(site)
        columns, size = cosines(at.travel[:, j], 1, 14, 1.2)
        return along_track(at, site, columns, unit(size, 5e-5))
