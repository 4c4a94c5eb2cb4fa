"""Thermal expansion of links and tracks. It is not uniform, and follows the sensor with a delay."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.causes.drives import along
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.fields import curve
from gtpin.bench.simulator.situation import Situation

STEEL = 11.5e-6
"""Coefficient of linear expansion, 1/K."""


def thermal_links(site: Site, rng: np.random.Generator) -> Cause:
    """Steel links, each a little warmer or cooler than the sensor, with a delay, and a factor that changes over the day."""
    warmer = rng.normal(1.0, 0.06, len(site.rods))
    delays = rng.uniform(0.0, 150.0) + rng.uniform(0.0, 40.0, len(site.rods))
    local, part = [curve(rng, 0.0, 1.0, 0.25, "twice") for _ in site.rods], rng.uniform(0.01, 0.04)

    def cause(now: Situation) -> Deviation:
        visits, lengths = now.visits, now.machine.kinematics.L0
        deviation = now.unbent()
        for i, rod in enumerate(site.rods):
            growth = warmer[i] * (visits.day.link_at(visits.time, delays[i]) - visits.day.link[0])
            growth *= 1.0 + part * local[i](visits.phase)
            deviation.length[:, rod] = STEEL * lengths[rod] * growth
        return deviation

    return cause


def thermal_track(site: Site, rng: np.random.Generator) -> Cause:
    """A steel guideway that expands from the point at which it is pinned. The frame restrains the expansion, and one end
    becomes warmer than the other."""
    pinned, held = rng.uniform(-1.5, 1.5), rng.uniform(0.6, 1.0)
    delay, uneven = rng.uniform(0.0, 300.0), rng.uniform(-0.15, 0.15)
    local, part = curve(rng, 0.0, 1.0, 0.25, "twice"), rng.uniform(0.02, 0.1)

    def cause(now: Situation) -> Deviation:
        visits, q = now.visits, now.q[:, site.cart]
        growth = (visits.day.frame_at(visits.time, delay) - visits.day.frame[0]) * (1.0 + part * local(visits.phase))
        return along(now, site, held * STEEL * growth * (q - pinned + uneven * (q**2 - pinned**2)))

    return cause
