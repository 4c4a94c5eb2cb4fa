"""Unlisted loads: a hose, a cable chain, a payload off centre."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.causes.stiffness import GIVE, STRETCH
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.fields import Field, curve
from gtpin.bench.simulator.machine import REACH
from gtpin.bench.simulator.situation import Situation
from gtpin.typing import Floats


def hose_drag(site: Site, rng: np.random.Generator) -> Cause:
    """A hose pulls the platform towards its anchor, with a force that increases with the distance, and against the last
    move."""
    anchor = np.array([rng.uniform(-0.8, 0.8), rng.uniform(-0.8, 0.8), rng.uniform(0.8, 2.0)])  # m from home
    seat = rng.uniform(-0.15, 0.15, 3)  # TCP frame, m
    stiffness, drag = rng.uniform(15.0, 50.0), rng.uniform(10.0, 30.0)
    stiffer = Field.draw(rng, [0.4] * 3)

    def cause(now: Situation) -> Deviation:
        from_home = now.poses.T - now.machine.kinematics.home.T[0]
        lever = now.poses.R @ seat
        way = anchor - from_home - lever
        force = stiffness * way * (1.0 + 0.2 * stiffer(from_home))[:, None]
        force -= drag * (1.0 + 0.5 * np.tanh(from_home[:, [0]] / 0.2)) * now.motion
        return _yielding(now, now.held(np.hstack([force, np.cross(lever, force)])))

    return cause


def _yielding(now: Situation, forces: Floats) -> Deviation:
    """The deviation of an elastic machine by additional rod forces (N, k), N."""
    deviation = now.unbent()
    deviation.length[:] = STRETCH * forces
    for cart in range(now.machine.n_carts):
        deviation.travel[:, cart] = GIVE * now.pressing(cart, forces)
    return deviation


def cable_chain(site: Site, rng: np.random.Generator) -> Cause:
    """A cable chain on a cart: it pulls more the longer its hanging part is, sticks to its tray, and tilts the cart."""
    weight, drag = rng.uniform(40.0, 100.0), rng.uniform(30.0, 80.0)  # N
    tray, level = curve(rng, -REACH, REACH, 0.15, "once"), rng.uniform(-0.3, 0.3)
    arm = rng.uniform(-0.3, 0.3, 3)  # m

    def cause(now: Situation) -> Deviation:
        cart, place = site.cart, now.places[:, site.cart]
        track = now.machine.tracks[cart]
        hanging = weight * np.logaddexp(0.0, (place - level) / 0.1) * 0.2
        sticking = drag * now.visits.approach[:, cart] * (1.0 + 0.6 * tray(place)).clip(0.1)
        force = (hanging - sticking)[:, None] * track + hanging[:, None] * np.array([0.0, 0.0, -1.0])
        deviation = now.unbent()
        deviation.shift[:, cart] = GIVE * force
        deviation.turn[:, cart] = 2e-6 * np.cross(arm, force)
        return deviation

    return cause


def plate_bending(site: Site, rng: np.random.Generator) -> Cause:
    """A payload off centre bends the platform: each of its joints shifts by 20 um per axis at 20 kg, more than proportionally
    to the payload."""
    ways, exponent = 2e-5 * rng.standard_normal((20, 3)), rng.uniform(1.0, 1.4)
    swing = rng.uniform(0.0, 0.3)

    def cause(now: Situation) -> Deviation:
        load = (now.visits.payload / 20.0) ** exponent * (1.0 + swing * now.motion[:, 2])
        deviation = now.unbent()
        deviation.joint[:] = load[:, None, None] * ways[: now.machine.n_rods]
        return deviation

    return cause
