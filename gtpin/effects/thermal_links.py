"""Links grow with their temperature."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, of_lengths, rods_of
from gtpin.effects.effect import Effect, arm_and_links, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class ThermalLinks(Effect):
    """dL = alpha L (temp_link - reference). Steel 12e-6, aluminium 23e-6, carbon about 1e-6 per kelvin."""

    id = "thermal_links"
    title = "links grow with their temperature"
    coefficient = ("expansion", "1/K")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """All links together, and each."""
        return arm_and_links(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The links' temperature."""
        return ("temp_link",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """One expansion, what each link differs by, and a lag behind the thermometer that grows with time."""
        rods = rods_of(at, site)
        warm = at.covariate("temp_link") - at.references.temperature
        growth = warm[:, None] * at.length[:, rods]
        columns, sizes = [growth], [1.0]
        if len(rods) > 1:
            columns += [growth * (np.arange(len(rods)) == i) for i in range(len(rods))]
            sizes += [0.2] * len(rods)
        if at.has("time"):
            columns.append(growth * at.time[:, None])
            sizes.append(0.15)
        columns.append(growth * np.abs(warm)[:, None] / 5.0)
        sizes.append(0.1)
        return of_lengths(at, rods, np.stack(columns, axis=2), unit(sizes, 8e-6))
