"""Errors of a guideway: shifts of a cart across its track, and its rotations."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.fields import curve, uneven_curve
from gtpin.bench.simulator.machine import REACH
from gtpin.bench.simulator.situation import Situation


def straightness(site: Site, rng: np.random.Generator) -> Cause:
    """30 um in each of two directions across the track; some per cent depend on the load of the cart on its rail."""
    errors = [uneven_curve(rng, -REACH, REACH) for _ in "ab"]
    sizes, load = rng.uniform(0.5, 1.5, 2), rng.uniform(-0.1, 0.1)

    def cause(now: Situation) -> Deviation:
        place, across = now.places[:, site.cart], now.machine.across[site.cart]
        pressed = 1.0 + load * np.tanh(now.pull(site.cart)[:, 2] / 300.0)
        deviation = now.unbent()
        for error, size, axis in zip(errors, sizes, across, strict=True):
            deviation.shift[:, site.cart] += (3e-5 * size * pressed * error(place))[:, None] * axis
        return deviation

    return cause


def cart_rotation(site: Site, rng: np.random.Generator) -> Cause:
    """60 urad of roll, pitch and yaw, and a smaller rough part."""
    errors = [uneven_curve(rng, -REACH, REACH) for _ in "abc"]
    blocks = [curve(rng, -REACH, REACH, 0.04, "rough") for _ in "abc"]
    sizes, part = rng.uniform(0.4, 1.6, 3), rng.uniform(0.02, 0.12)

    def cause(now: Situation) -> Deviation:
        place = now.places[:, site.cart]
        axes = np.vstack([now.machine.across[site.cart], now.machine.tracks[site.cart]])
        angles = [size * (e(place) + part * b(place)) for e, b, size in zip(errors, blocks, sizes, strict=True)]
        deviation = now.unbent()
        deviation.turn[:, site.cart] = 6e-5 * np.column_stack(angles) @ axes
        return deviation

    return cause
