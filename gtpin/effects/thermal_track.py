"""A guideway grows with the frame's temperature, from a fixed point."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import Effect, Floats, carts, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class ThermalTrack(Effect):
    """dq = alpha (q - q0) (temp_frame - reference), linear in alpha and alpha q0. Steel: 12e-6 per kelvin."""

    id = "thermal_track"
    title = "the guideway grows with the frame's temperature"
    coefficient = ("expansion", "1/K")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The frame's temperature."""
        return ("temp_frame",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Growth along the track, growth at its zero, and bends."""
        j = at.robot.sites.index(site)
        warm = at.covariate("temp_frame") - at.references.temperature
        q = at.q[:, j]
        columns = [warm * q, warm, warm * q * at.travel[:, j]]
        sizes = [1.0, 0.7, 0.15]
        if at.has("time"):
            columns += [warm * q * at.time, warm * at.time]
            sizes += [0.15, 0.1]
        return along_track(at, site, np.stack(columns, axis=1), unit(sizes, 1e-5))

    def parameters(self, coefficients: Floats, setting: float | None) -> dict[str, tuple[float, str]]:
        """Expansion and the point that stays."""
        expansion = float(coefficients[0])
        fixed = -float(coefficients[1]) / expansion if expansion else 0.0
        return {"expansion": (expansion, "1/K"), "fixed_point": (fixed, "m")}
