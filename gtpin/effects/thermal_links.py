"""Thermal expansion of links."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis, of_lengths, rods_of
from gtpin.effects.chain_motions import of_tips, reach
from gtpin.effects.effect import Effect, Range, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import arm_and_links, links, links_at
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


class ThermalLinks(Effect):
    """dL = alpha L (temp_link - reference): a warm link is longer where alpha > 0.

    L is the link's length, m, and dL its change. The reference is the dataset's ``reference_temperature``, degC. The
    modulation: alpha changes with time, because the sensor does not measure the link itself, and with the temperature
    difference. At ``arm`` each link differs a little from the others. A link of a robot without rods expands along the line
    from its joint to the next joint.

    Parameters: ``expansion`` alpha, 1/K, at ``arm`` the mean of all links; at ``arm`` ``spread``: the standard deviation of
    alpha between the links, 1/K.

    Typical size 8e-6 / K: larger than carbon fibre along the tube (-1e-6 to 1e-6 / K), smaller than steel (12e-6 / K) and
    aluminium (23e-6 / K; handbook values). For links of robots without rods 1.5e-5 / K.
    """

    id = "thermal_links"
    title = "thermal growth of links"
    clause = "{site} grows with its temperature"
    plural_clause = "{site} grow with their temperature"
    remedy = "Let the machine warm up, or use the corrected model with the links' temperature measured."
    coefficient = ("expansion", "1/K")
    core = (0,)
    plausible: ClassVar[Mapping[str, Range]] = {
        "expansion": Range(
            -2e-6, 1e-4, "of link materials only carbon fibre shrinks with heat, by 1e-6/K; plastics expand by 1e-4/K"
        )
    }
    usual: ClassVar[Mapping[str, Range]] = {
        "expansion": Range(4e-6, 3.5e-5, "steel has 12e-6/K, and few links have a third or three times as much")
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """``arm``, that is all links together, and each link."""
        return arm_and_links(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The links' temperature."""
        return ("temp_link",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """The common expansion, then its modulation: temperature difference, time, and for robots with rods each link."""
        warm = at.covariate("temp_link") - at.references.temperature
        late = at.time if at.has("time") else np.zeros(len(at))
        if not links(at.robot):
            factors = np.stack([warm, warm * np.abs(warm) / 5.0, warm * late], axis=1)
            twists = []
            for link in links_at(at.robot, site):
                along = np.concatenate([reach(at, link), np.zeros(3)])
                twists.append(along[None, :, None] * factors[:, None, :])
            return of_tips(at, site, twists, unit([1.0, MODULATION.warming, MODULATION.late], 1.5e-5))
        rods = rods_of(at, site)
        growth = warm[:, None] * at.length[:, rods]
        columns = [growth, growth * np.abs(warm)[:, None] / 5.0, growth * late[:, None]]
        sizes = [1.0, MODULATION.warming, MODULATION.late]
        if len(rods) > 1:
            columns += [growth * (np.arange(len(rods)) == i) for i in range(len(rods))]
            sizes += [MODULATION.links] * len(rods)
        return of_lengths(at, rods, np.stack(columns, axis=2), unit(sizes, 8e-6))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """The mean expansion, and the standard deviation between links."""
        own = coefficients[3:]
        if not own.size:
            return {"expansion": (float(coefficients[0]), "1/K")}
        return {"expansion": (float(coefficients[0] + own.mean()), "1/K"), "spread": (float(own.std()), "1/K")}
