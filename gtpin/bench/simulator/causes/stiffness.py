"""Compliance: of carts on their guides and drives, of links and their joints."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.fields import curve
from gtpin.bench.simulator.machine import REACH
from gtpin.bench.simulator.situation import Situation
from gtpin.typing import Floats

GIVE = 1e-7
"""Compliance of a cart along its track at small forces, m/N: a rack and pinion of 10 N/um."""
STRETCH = 5e-8
"""Compliance of a link with its two joints at small forces, m/N: 20 N/um."""


def hertz(force: Floats, exponent: float, scale: float) -> Floats:
    """The force (any shape) on a linear spring that deflects as much as a stiffening contact, in the unit of ``force``.

    It is proportional to the force well below ``scale``, and to |force|^``exponent`` well above it.
    """
    return np.asarray(force * (1.0 + (force / scale) ** 2) ** ((exponent - 1.0) / 2.0))


def cart_compliance(site: Site, rng: np.random.Generator) -> Cause:
    """A cart on springs that become stiffer under load: shifts along and across its track, and rotations. The compliance varies
    along the track, and there is some hysteresis."""
    exponent, scale = rng.uniform(0.75, 0.95), rng.uniform(100.0, 400.0)
    give = GIVE * np.array([rng.uniform(0.7, 1.3), *rng.uniform(0.1, 0.6, 2)])
    tip = rng.uniform(0.5, 2.0, 3) * 5e-7  # rad per N m
    softer, part = curve(rng, -REACH, REACH, 0.3), rng.uniform(0.02, 0.1)
    friction = rng.uniform(0.0, 0.05)

    def cause(now: Situation) -> Deviation:
        axes = np.vstack([now.machine.tracks[site.cart], now.machine.across[site.cart]])
        soft = (1.0 + part * softer(now.places[:, site.cart]))[:, None]
        force = now.pull(site.cart) @ axes.T
        left = 1.0 + friction * now.visits.approach[:, [site.cart]] * np.sign(force)
        deviation = now.unbent()
        deviation.shift[:, site.cart] = (soft * left * give * hertz(force, exponent, scale)) @ axes
        deviation.turn[:, site.cart] = (
            soft * tip * hertz(now.moment(site.cart) @ axes.T, exponent, scale / 5.0)
        ) @ axes
        return deviation

    return cause


def link_compliance(site: Site, rng: np.random.Generator) -> Cause:
    """Links that stretch, each with its own compliance. They become stiffer under load, are stiffer in compression than in
    tension, and have some hysteresis."""
    exponent, scale = rng.uniform(0.75, 0.95), rng.uniform(100.0, 400.0)
    give = STRETCH * rng.normal(1.0, 0.12, len(site.rods)).clip(0.6, 1.4)
    harder, friction = rng.uniform(0.0, 0.2), rng.uniform(0.0, 0.05)

    def cause(now: Situation) -> Deviation:
        force, drivers = now.forces[:, site.rods], now.machine.driver[list(site.rods)]
        left = 1.0 + friction * now.visits.approach[:, drivers]
        harder_side = np.where(force < 0.0, 1.0 - harder, 1.0)
        deviation = now.unbent()
        deviation.length[:, site.rods] = give * left * harder_side * hertz(force, exponent, scale)
        return deviation

    return cause
