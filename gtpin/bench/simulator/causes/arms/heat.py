"""Thermal expansion of links. It is not uniform, and follows the sensor with a delay."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.arms.deviation import ArmDeviation
from gtpin.bench.simulator.arms.situation import ArmSituation
from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.fields import curve

ALUMINIUM = 23e-6
"""Coefficient of linear expansion, 1/K."""


def thermal_links(site: Site, rng: np.random.Generator) -> Cause:
    """Aluminium links that expand from their own joint to the next; each is warmer or cooler than the sensor, with a delay."""
    count = len(site.rods)
    warmer, delays = rng.normal(1.0, 0.06, count), rng.uniform(0.0, 150.0) + rng.uniform(0.0, 40.0, count)
    local, part = [curve(rng, 0.0, 1.0, 0.25, "twice") for _ in range(count)], rng.uniform(0.01, 0.04)

    def cause(now: ArmSituation) -> ArmDeviation:
        visits, machine, deviation = now.visits, now.machine, now.unbent()
        for i, link in enumerate(site.rods):
            if link in machine.robot.linked:
                growth = warmer[i] * (visits.day.link_at(visits.time, delays[i]) - visits.day.link[0])
                growth = growth * (1.0 + part * local[i](visits.phase))
                reach = machine.robot.next_frame(machine.robot.counted[link]).p
                deviation.tip[:, link, :3] = ALUMINIUM * np.multiply.outer(growth, reach)
        return deviation

    return cause
