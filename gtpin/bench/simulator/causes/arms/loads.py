"""Errors by loads: compliance of drives about their axes, play, bending and torsion of links."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.arms.deviation import ArmDeviation
from gtpin.bench.simulator.arms.machine import REACH
from gtpin.bench.simulator.arms.situation import ArmSituation
from gtpin.bench.simulator.causes.arms.drives import turned
from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.causes.stiffness import hertz
from gtpin.bench.simulator.fields import curve
from gtpin.typing import Floats

WEIGHT = 3.0 / 8.0
"""Share of a beam's weight that, at the beam's end, deflects the end as much as the distributed weight does."""


def joint_compliance(site: Site, rng: np.random.Generator) -> Cause:
    """0.15 mrad at the joint's usual torque: wind-up of a gear whose stiffness increases with the torque.

    Strain-wave gears of 5 to 30 kN m/rad wind up by 1 to 3 mrad under 10 to 60 N m; controllers compensate most of it. There is
    some hysteresis by the direction of approach, and the compliance varies over the turn.
    """
    exponent, friction = rng.uniform(0.75, 0.95), rng.uniform(0.0, 0.05)
    softer, part = curve(rng, -REACH, REACH, 0.3), rng.uniform(0.02, 0.08)

    def cause(now: ArmSituation) -> ArmDeviation:
        cart = site.cart
        load = now.load(cart) / now.machine.usual_load(cart)
        left = 1.0 - friction * now.visits.approach[:, cart] * np.sign(load)
        return turned(
            now, site, 1.5e-4 * left * hertz(load, exponent, 1.0) * (1.0 + part * softer(now.places[:, cart]))
        )

    return cause


def joint_clearance(site: Site, rng: np.random.Generator) -> Cause:
    """0.07 mrad to either side, reached at about a tenth of the usual load, and 2 um of play in the bearing along the force."""
    seated, wider = rng.uniform(0.03, 0.15), rng.uniform(0.0, 0.1)
    uneven, part = curve(rng, -REACH, REACH, 0.35), rng.uniform(0.01, 0.05)

    def cause(now: ArmSituation) -> ArmDeviation:
        cart, machine = site.cart, now.machine
        load = now.load(cart) / machine.usual_load(cart)
        gap = (1.0 + wider * np.tanh(np.abs(load))) * (1.0 + part * uneven(now.places[:, cart]))
        deviation = turned(now, site, 7e-5 * np.tanh(load / seated) * gap)
        force = np.einsum("nji,nj->ni", now.bodies.seats[:, machine.robot.counted[cart]], now.borne(cart)[0])
        deviation.axis[:, cart, :3] = 2e-6 * force / np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-6)
        return deviation

    return cause


def link_compliance(site: Site, rng: np.random.Generator) -> Cause:
    """0.1 mrad over a link by the load at its end: bending and torsion of beams, with some compliance at the root of each.

    Aluminium tubes of small arms have E I of 1e4 to 1e5 N m^2. ``arm``: all links have the same cross section. A single link:
    its cross section is made for its load.
    """
    exponent, softer_twist = rng.uniform(0.85, 1.0), rng.uniform(1.2, 1.8)
    each = rng.normal(1.0, 0.1, len(site.rods)).clip(0.6, 1.4)
    root, uneven = rng.uniform(0.0, 0.15, len(site.rods)), rng.uniform(0.85, 1.15, (len(site.rods), 3))

    def cause(now: ArmSituation) -> ArmDeviation:
        machine, deviation = now.machine, now.unbent()
        common = machine.common_flexibility
        for i, link in enumerate(site.rods):
            if link not in machine.robot.linked:
                continue
            flexibility = each[i] * (common if len(site.rods) > 1 else machine.flexibility(link))
            bent = _beam(now, link, flexibility * uneven[i], softer_twist, root[i], exponent)
            deviation.tip[:, link] = bent
        return deviation

    return cause


def _beam(
    now: ArmSituation, link: int, flexibility: Floats, softer_twist: float, root: float, exponent: float
) -> Floats:
    """(N, 6) shift, m, and rotation, rad, of a link's end, link's frame: a cantilever with 1/EI ``flexibility`` (3,), 1/(N
    m^2), about the axes of that frame."""
    machine = now.machine
    j = machine.robot.counted[link]
    end = machine.robot.next_frame(j).p
    length = machine.robot.length(j)
    spans = float(np.linalg.norm(end)) > 1e-3
    u = end / np.linalg.norm(end) if spans else machine.joints[j].axis
    force, moment = now.tip_load(link)
    weight = np.einsum("nji,j->ni", now.bodies.R[:, j], WEIGHT * machine.masses[j] * machine.robot.gravity)
    force = force + weight
    usual = machine.usual_load(link)
    force, moment = (
        usual / length * hertz(force * length / usual, exponent, 3.0),
        usual * hertz(moment / usual, exponent, 3.0),
    )
    lever = np.cross(u, force)
    twisting = np.outer(moment @ u, u)
    turn = flexibility * (length * (moment - twisting + softer_twist * twisting) + 0.5 * length**2 * lever)
    shift = np.cross(flexibility * (0.5 * length**2 * moment + length**3 / 3.0 * lever), u)
    at_root = root * flexibility * length * (moment + length * lever)
    return np.hstack([shift + np.cross(at_root, length * u), turn + at_root])
