"""Deviation that follows the direction of approach."""

from __future__ import annotations

from gtpin.effects.basis import Basis, along_track, rods_of
from gtpin.effects.effect import Effect, carts, number, unit
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import bent
from gtpin.robot.robot import Robot


class Backlash(Effect):
    """dq = b approach / 2, a little more or less along the track and with the load. Rack and pinion: 10 to 100 um."""

    id = "backlash"
    title = "deviation that follows the direction of approach"
    coefficient = ("half_width", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The actuator's direction of approach."""
        return (f"approach{number(robot, site)}",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """The direction of approach, and its bends with travel and load."""
        j = at.robot.sites.index(site)
        load = at.load[:, rods_of(at, site)].mean(axis=1)
        approach = at.covariate(f"approach{number(at.robot, site)}")
        columns, size = bent(approach, [at.travel[:, j], load / 2.0], 0.2)
        return along_track(at, site, columns, unit(size, 1.5e-5))
