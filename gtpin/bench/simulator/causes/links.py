"""Errors of links, joints and carts by loads and heat, on machines with rods."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.fields import Field, curve
from gtpin.bench.simulator.machine import REACH
from gtpin.bench.simulator.situation import RodSituation
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

    def cause(now: RodSituation) -> Deviation:
        axes = np.vstack([now.machine.tracks[site.cart], now.machine.across[site.cart]])
        soft = (1.0 + part * softer(now.places[:, site.cart]))[:, None]
        force = now.pull(site.cart) @ axes.T
        left = 1.0 + friction * now.visits.approach[:, [site.cart]] * np.sign(force)
        return now.off(
            shift=(site.cart, (soft * left * give * hertz(force, exponent, scale)) @ axes),
            turn=(site.cart, (soft * tip * hertz(now.moment(site.cart) @ axes.T, exponent, scale / 5.0)) @ axes),
        )

    return cause


def link_compliance(site: Site, rng: np.random.Generator) -> Cause:
    """Links that stretch, each with its own compliance. They become stiffer under load, are stiffer in compression than in
    tension, and have some hysteresis."""
    exponent, scale = rng.uniform(0.75, 0.95), rng.uniform(100.0, 400.0)
    give = STRETCH * rng.normal(1.0, 0.12, len(site.rods)).clip(0.6, 1.4)
    harder, friction = rng.uniform(0.0, 0.2), rng.uniform(0.0, 0.05)

    def cause(now: RodSituation) -> Deviation:
        force, drivers = now.forces[:, site.rods], now.machine.driver[list(site.rods)]
        left = 1.0 + friction * now.visits.approach[:, drivers]
        harder_side = np.where(force < 0.0, 1.0 - harder, 1.0)
        return now.off(length=(site.rods, give * left * harder_side * hertz(force, exponent, scale)))

    return cause


def joint_clearance(site: Site, rng: np.random.Generator) -> Cause:
    """15 um to either side, reached at some newtons of tension or compression; larger under load, when the joint yields."""
    (rod,) = site.rods
    seated, wider = rng.uniform(2.0, 15.0), rng.uniform(0.02, 0.1)
    uneven, part = Field.draw(rng, [0.3] * 3), rng.uniform(0.01, 0.04)

    def cause(now: RodSituation) -> Deviation:
        force = now.forces[:, rod]
        gap = (1.0 + wider * np.tanh(np.abs(force) / 200.0)) * (1.0 + part * uneven(now.along[:, rod]))
        return now.off(length=(rod, 1.5e-5 * np.tanh(force / seated) * gap))

    return cause


def joint_runout(site: Site, rng: np.random.Generator) -> Cause:
    """15 um: two balls that are not round, one at the cart and one at the platform. The error changes a little with the
    load."""
    (rod,) = site.rods
    on_cart, on_plate = Field.draw(rng, [0.25] * 3), Field.draw(rng, [0.25] * 3)
    share, load = rng.uniform(0.0, 0.5), rng.uniform(-0.15, 0.15)

    def cause(now: RodSituation) -> Deviation:
        u = now.along[:, rod]
        out = on_cart(u) + share * on_plate(np.einsum("ni,nij->nj", u, now.poses.R))
        return now.off(length=(rod, 1.5e-5 * out * (1.0 + load * np.tanh(now.forces[:, rod] / 200.0))))

    return cause


STEEL = 11.5e-6
"""Coefficient of linear expansion, 1/K."""


def thermal_links(site: Site, rng: np.random.Generator) -> Cause:
    """Steel links, each a little warmer or cooler than the sensor, with a delay, and a factor that changes over the day."""
    warmer = rng.normal(1.0, 0.06, len(site.rods))
    delays = rng.uniform(0.0, 150.0) + rng.uniform(0.0, 40.0, len(site.rods))
    local, part = [curve(rng, 0.0, 1.0, 0.25, "twice") for _ in site.rods], rng.uniform(0.01, 0.04)

    def cause(now: RodSituation) -> Deviation:
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

    def cause(now: RodSituation) -> Deviation:
        visits, q = now.visits, now.q[:, site.cart]
        growth = (visits.day.frame_at(visits.time, delay) - visits.day.frame[0]) * (1.0 + part * local(visits.phase))
        return now.driven(site.cart, held * STEEL * growth * (q - pinned + uneven * (q**2 - pinned**2)))

    return cause
