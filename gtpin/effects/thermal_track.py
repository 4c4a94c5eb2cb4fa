"""Thermal expansion of a guideway about a fixed point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import ChainWords, Effect, Range, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import tracks, turns
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


class ThermalTrack(Effect):
    """dq = alpha (q - q0) (temp_frame - reference); dq is the deviation of the travel from the command q, m.

    q0 is the fixed point: the command at which the track does not move. When the frame is warmer than the reference and
    alpha > 0, a cart at q > q0 is farther along its track than commanded. The reference is the dataset's
    ``reference_temperature``, degC. The coefficients are alpha and -alpha q0. The modulation: one end of the track may become
    warmer than the other, and the expansion may change with time, because the sensor does not measure the track itself.

    Parameters: ``expansion`` alpha, 1/K; ``at_zero`` = -alpha q0, m/K: the displacement of the cart at q = 0 per kelvin;
    ``fixed_point`` q0, m, which is inaccurate where alpha is small.

    Typical size 1e-5 / K: steel has 12e-6 / K (handbook value). The frame that holds the track may expand less or more.
    """

    id = "thermal_track"
    title = "thermal growth of the track"
    clause = "the guideway of {site} grows with the frame's temperature"
    of_chains = ChainWords(clause="the travel of {site} grows with the frame's temperature")
    remedy = "Let the machine warm up, or use the corrected model with the frame's temperature measured."
    coefficient = ("expansion", "1/K")
    of_travel = True
    core = (0, 1)
    plausible: ClassVar[Mapping[str, Range]] = {
        "expansion": Range(-2e-6, 1e-4, "no guideway shrinks with heat, and even plastics expand by only 1e-4/K")
    }
    usual: ClassVar[Mapping[str, Range]] = {
        "expansion": Range(4e-6, 3.5e-5, "steel has 12e-6/K, and few guideways have a third or three times as much")
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every sliding actuator of a robot with rods: an angle does not grow with heat."""
        return tuple(site for site in tracks(robot) if not turns(robot, site))

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The frame's temperature."""
        return ("temp_frame",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Expansion in proportion to the command, motion of the track's zero, and their modulation."""
        j = at.robot.sites.index(site)
        warm = at.covariate("temp_frame") - at.references.temperature
        q = at.q[:, j]
        columns = [warm * q, warm, warm * q * at.travel[:, j]]
        sizes = [1.0, 0.7, MODULATION.uneven]
        if at.has("time"):
            columns += [warm * q * at.time, warm * at.time]
            sizes += [MODULATION.late, MODULATION.late_zero]
        return along_track(at, site, np.stack(columns, axis=1), unit(sizes, 1e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """The expansion, the motion of the track's zero, and the fixed point."""
        expansion, zero = (float(c) for c in coefficients[:2])
        fixed = -zero / expansion if expansion else 0.0
        return {"expansion": (expansion, "1/K"), "at_zero": (zero, "m/K"), "fixed_point": (fixed, "m")}
