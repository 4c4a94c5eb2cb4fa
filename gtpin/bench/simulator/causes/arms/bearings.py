"""Errors of a joint's axis: error motions as the joint moves, and compliance of its bearing under moments."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.arms.deviation import ArmDeviation
from gtpin.bench.simulator.arms.machine import REACH
from gtpin.bench.simulator.arms.situation import ArmSituation
from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.causes.stiffness import hertz
from gtpin.bench.simulator.fields import Field, curve, uneven_curve
from gtpin.bench.simulator.rotations import across

MOTIONS = np.array([2e-5, 2e-5, 7e-6, 5e-5, 5e-5, 0.0])
"""Typical error motions (ISO 230-7): two radial and one axial, m; tilt about two axes across the joint's, rad; no rotation
about it. Cross-roller bearings of small arms have a runout of 5 to 20 um at their diameter of about 0.1 m."""


def axis_motion(site: Site, rng: np.random.Generator) -> Cause:
    """20 um and 50 urad: the axis shifts and tilts with the joint's angle, slow changes being the largest; some per cent by
    load.

    The error motion is a random smooth periodic function of the angle, not a series of harmonics. A prismatic joint has
    straightness errors and rolls along its guide.
    """
    fields = [Field.draw(rng, [0.8, 0.8]) for _ in range(6)]
    curves = [uneven_curve(rng, -REACH, REACH) for _ in range(6)]
    sizes, phase = rng.uniform(0.4, 1.6, 6), rng.uniform(0.0, 2.0 * np.pi)
    lean, wobble = rng.uniform(0.0, 0.06, 6), Field.draw(rng, [0.5, 0.5])

    def cause(now: ArmSituation) -> ArmDeviation:
        cart, machine = site.cart, now.machine
        q, own = now.q[:, cart] + phase, machine.joints[machine.robot.counted[cart]].axis
        circle = np.column_stack([np.cos(q), np.sin(q)])
        slides = machine.robot.slides[cart]
        values = np.column_stack([c(now.places[:, cart]) for c in curves] if slides else [f(circle) for f in fields])
        moment = np.linalg.norm(now.borne(cart)[1], axis=1) / machine.usual_load(cart)
        values = values * sizes * (1.0 + lean * np.tanh(moment)[:, None] * wobble(circle)[:, None])
        shape = np.array([2e-5, 2e-5, 0.0, 5e-5, 5e-5, 5e-5]) if slides else MOTIONS
        frame = np.vstack([across(own), own])
        deviation = now.unbent()
        deviation.axis[:, cart, :3] = (values * shape)[:, :3] @ frame
        deviation.axis[:, cart, 3:] = (values * shape)[:, 3:] @ frame
        return deviation

    return cause


def bearing_compliance(site: Site, rng: np.random.Generator) -> Cause:
    """60 urad at the joint's usual moment: a bearing that tilts about the two axes across the joint's axis.

    Cross-roller bearings of strain-wave units have a compliance of 1e-6 to 1e-5 rad/(N m). It decreases with the load, depends
    on the joint's angle, differs between the two axes, and has a small coupling of them.
    """
    exponent, softer = rng.uniform(0.75, 0.95), curve(rng, -REACH, REACH, 0.35)
    give, part = rng.uniform(0.6, 1.4, 2), rng.uniform(0.02, 0.1)
    mixed = rng.uniform(-0.12, 0.12)

    def cause(now: ArmSituation) -> ArmDeviation:
        cart, machine = site.cart, now.machine
        j, usual = machine.robot.counted[cart], machine.usual_load(cart)
        own = machine.joints[j].axis
        moment = np.einsum("nji,nj->ni", now.bodies.seats[:, j], now.borne(cart)[1])
        carried = moment @ across(own).T / usual
        carried = carried + mixed * carried[:, ::-1]
        tilt = 6e-5 * give * hertz(carried, exponent, 1.0) * (1.0 + part * softer(now.places[:, [cart]]))
        deviation = now.unbent()
        deviation.axis[:, cart, 3:] = tilt @ across(own)
        return deviation

    return cause
