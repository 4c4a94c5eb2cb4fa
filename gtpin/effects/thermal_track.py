"""A guideway grows with the frame's temperature, from a fixed point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import ChainWords, Effect, Floats, Range, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import tracks
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class ThermalTrack(Effect):
    """dq = alpha (q - q0) (temp_frame - reference): in the warm a cart beyond the fixed point q0 is farther along its track.

    Linear in alpha and -alpha q0. One end of the track may warm more than the other, and the growth may go on or fade with
    the time, as the thermometer is not the track.

    Parameters: ``expansion`` alpha, 1/K; ``at_zero`` = -alpha q0, m/K: how far the cart at q = 0 moves for every kelvin;
    ``fixed_point`` q0, m, of little meaning where alpha is small.

    Typical size 1e-5 / K: steel has 12e-6 / K (handbook value), and the frame on which the track is held less or more.
    """

    id = "thermal_track"
    title = "the guideway grows with the frame's temperature"
    clause = "the guideway of {site} grows with the frame's temperature"
    of_chains = ChainWords(clause="the travel of {site} grows with the frame's temperature")
    remedy = "Let the machine warm up, or use the corrected model with the frame's temperature measured."
    coefficient = ("expansion", "1/K")
    core = (0, 1)
    plausible: ClassVar[Mapping[str, Range]] = {
        "expansion": Range(-2e-6, 1e-4, "no guideway shrinks in the warm, and plastics grow by 1e-4/K")
    }
    usual: ClassVar[Mapping[str, Range]] = {
        "expansion": Range(4e-6, 3.5e-5, "steel has 12e-6/K: a third or three times as much is seldom a guideway's")
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator of a robot with rods."""
        return tracks(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The frame's temperature."""
        return ("temp_frame",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Growth along the track, growth at its zero, and their modulation."""
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
        """Expansion, the motion of the track's zero, and the point that stays."""
        expansion, zero = (float(c) for c in coefficients[:2])
        fixed = -zero / expansion if expansion else 0.0
        return {"expansion": (expansion, "1/K"), "at_zero": (zero, "m/K"), "fixed_point": (fixed, "m")}
