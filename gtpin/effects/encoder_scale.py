"""Scale error of a drive: its travel per count is wrong by a constant factor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import ChainWords, Effect, Range, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import carts
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import modulated
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


class EncoderScale(Effect):
    """dq = s q: the travel is 1 + s times the command q; s > 0 where the actuator moves farther than commanded.

    dq is the deviation of the travel from the command, m (rad where the actuator turns). The modulation: s varies a little
    along the track.

    Parameters: ``scale`` s, m/m (rad/rad where the actuator turns); ``uneven``: s at the upper end of the range less s at the
    lower end, in the same unit.

    Typical size 1e-4. The pitch error of a precision rack is at most 12 um per 500 mm, 24e-6 (Machine Design, Comparing
    Rack-and-Pinion Sets to Other Options). The norms of the track directions in Table II of Dressler et al. 2010 differ from
    1 by 0.5e-4 to 3.7e-4, which includes the drive's scale.
    """

    id = "encoder_scale"
    title = "wrong drive scale"
    clause = "travel per count of {site} is off by a constant factor"
    of_chains = ChainWords(
        clause="the motion of {site} per count is off by a constant factor",
        remedy="Set the drive's scale factor to the value below, and check the gear ratio.",
    )
    remedy = "Set the drive's scale factor to the value below, and check gear ratio or rack pitch."
    coefficient = ("scale", "m/m")
    of_travel = True
    exported_as = "drive_scale"
    core = (0,)
    plausible: ClassVar[Mapping[str, Range]] = {
        "scale": Range(-0.01, 0.01, "no drive's scale is off by a hundredth: its unit or gear ratio is wrong")
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Travel in proportion to the command, modulated a little along the track."""
        j = at.robot.sites.index(site)
        columns, size = modulated(at.q[:, j], [at.travel[:, j]], MODULATION.scale)
        return along_track(at, site, columns, unit(size, 1e-4))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """The scale, and its change from the lower to the upper end of the range."""
        return {"scale": (float(coefficients[0]), "m/m"), "uneven": (-2.0 * float(coefficients[1]), "m/m")}
