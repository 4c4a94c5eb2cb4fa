"""Errors of the spherical joints."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.fields import Field
from gtpin.bench.simulator.situation import Situation


def joint_clearance(site: Site, rng: np.random.Generator) -> Cause:
    """15 um to either side, reached at some newtons of tension or compression; larger under load, when the joint yields."""
    (rod,) = site.rods
    seated, wider = rng.uniform(2.0, 15.0), rng.uniform(0.02, 0.1)
    uneven, part = Field.draw(rng, [0.3] * 3), rng.uniform(0.01, 0.04)

    def cause(now: Situation) -> Deviation:
        force = now.forces[:, rod]
        gap = (1.0 + wider * np.tanh(np.abs(force) / 200.0)) * (1.0 + part * uneven(now.along[:, rod]))
        deviation = now.unbent()
        deviation.length[:, rod] = 1.5e-5 * np.tanh(force / seated) * gap
        return deviation

    return cause


def joint_runout(site: Site, rng: np.random.Generator) -> Cause:
    """15 um: two balls that are not round, one at the cart and one at the platform. The error changes a little with the
    load."""
    (rod,) = site.rods
    on_cart, on_plate = Field.draw(rng, [0.25] * 3), Field.draw(rng, [0.25] * 3)
    share, load = rng.uniform(0.0, 0.5), rng.uniform(-0.15, 0.15)

    def cause(now: Situation) -> Deviation:
        u = now.along[:, rod]
        out = on_cart(u) + share * on_plate(np.einsum("ni,nij->nj", u, now.poses.R))
        deviation = now.unbent()
        deviation.length[:, rod] = 1.5e-5 * out * (1.0 + load * np.tanh(now.forces[:, rod] / 200.0))
        return deviation

    return cause
