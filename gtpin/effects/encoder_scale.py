"""Travel per count of a drive is off by a constant factor."""

from __future__ import annotations

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import Effect, carts, unit
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import bent
from gtpin.robot.robot import Robot


class EncoderScale(Effect):
    """dq = s q. Racks are specified to some 1e-5 to 1e-4 of their length; the paper's fit absorbed 0.5e-4 to 3.7e-4."""

    id = "encoder_scale"
    title = "travel per count is off by a constant factor"
    coefficient = ("scale", "m/m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Travel in proportion to the command, bending a little along the track."""
        j = at.robot.sites.index(site)
        columns, size = bent(at.q[:, j], [at.travel[:, j]], 0.1)
        return along_track(at, site, columns, unit(size, 1e-4))
