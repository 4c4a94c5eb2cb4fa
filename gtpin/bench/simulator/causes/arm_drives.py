"""Errors of a joint's coordinate: of its encoder, gear and servo."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.arm_situation import ArmSituation
from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.fields import Field, curve
from gtpin.bench.simulator.machine import REACH
from gtpin.typing import Floats


def encoder_scale(site: Site, rng: np.random.Generator) -> Cause:
    """100 ppm of the coordinate, some of them not constant: pitch error of a belt stage, or lost counts of a prismatic
    joint."""
    uneven, part = curve(rng, -REACH, REACH, 0.3), rng.uniform(0.01, 0.03)
    sign = rng.choice([-1.0, 1.0])

    def cause(now: ArmSituation) -> Deviation:
        q, place = now.q[:, site.cart], now.places[:, site.cart]
        return now.off(travel=(site.cart, sign * 1e-4 * (q + part * uneven(place))))

    return cause


def rack_periodic(site: Site, rng: np.random.Generator, periods: tuple[float, ...] = ()) -> Cause:
    """0.1 mrad: one to three lines of 1 to 100 periods a turn; in half of the cases whole numbers.

    Strain-wave gears have kinematic errors of 0.1 to 0.5 mrad with two periods a turn of the input and neighbouring numbers,
    eccentric encoders one a turn. The amplitudes vary a little over the range, and each line has a weak second harmonic.
    """
    a_turn = np.array(periods) if periods else _drawn_periods(rng)
    lines = len(a_turn)
    sizes = np.array([1.0, *rng.uniform(0.3, 0.9, lines - 1)])
    phases, second = rng.uniform(0.0, 2.0 * np.pi, (2, lines)), rng.uniform(0.0, 0.12, lines)
    swell, depth = curve(rng, -REACH, REACH, 0.4, "twice"), rng.uniform(0.03, 0.15)

    def cause(now: ArmSituation) -> Deviation:
        q = now.q[:, site.cart] * (10.0 if now.machine.robot.slides[site.cart] else 1.0)  # a turn: 0.63 m of a rack
        angle = np.multiply.outer(q, a_turn)
        wave = np.sin(angle + phases[0]) + second * np.sin(2.0 * angle + phases[1])
        return now.driven(site.cart, 1e-4 * (wave @ sizes) * (1.0 + depth * swell(now.places[:, site.cart])))

    return cause


def _drawn_periods(rng: np.random.Generator) -> Floats:
    periods = np.exp(rng.uniform(0.0, np.log(100.0), int(rng.integers(1, 4))))
    return np.maximum(np.round(periods), 1.0) if rng.random() < 0.5 else periods


def backlash(site: Site, rng: np.random.Generator) -> Cause:
    """0.07 mrad to either side (lost motion of strain-wave gears is below 1 arc minute, 0.3 mrad, in all).

    The sum of friction in the last move and load decides the side: a joint with a large load by gravity stays on the side of
    the load; a vertical axis has friction alone. The play is larger where the teeth are worn.
    """
    drag, soft = rng.uniform(1.0, 4.0), rng.uniform(0.05, 0.2)
    wear, worn = rng.uniform(0.03, 0.15), curve(rng, -REACH, REACH, 0.35)
    taken = rng.uniform(0.003, 0.006)  # rad of motion until the friction has changed its sign

    def cause(now: ArmSituation) -> Deviation:
        cart, q = site.cart, now.q[:, site.cart]
        usual = now.machine.usual_load(cart)
        friction = drag * now.visits.approach[:, cart] * np.tanh(np.abs(q - now.visits.before[:, cart]) / taken)
        # Friction opposes the move, so the output stays on the side from which the last move came.
        side = np.tanh((now.load(cart) / usual - friction) / soft)
        return now.driven(site.cart, 7e-5 * side * (1.0 + wear * worn(now.places[:, cart])))

    return cause


def servo_lag(site: Site, rng: np.random.Generator) -> Cause:
    """0.5 ms times the speed, less at high speed, where feed-forward helps, and a part proportional to the acceleration."""
    saturation, inertia = rng.uniform(0.0, 0.8), rng.uniform(0.5e-5, 2e-5)
    uneven, part = curve(rng, -REACH, REACH, 0.3), rng.uniform(0.0, 0.12)

    def cause(now: ArmSituation) -> Deviation:
        speed, acceleration = now.visits.speed[:, site.cart], now.visits.acceleration[:, site.cart]
        lag = 5e-4 * speed / (1.0 + saturation * np.abs(speed)) * (1.0 + part * uneven(now.places[:, site.cart]))
        return now.off(travel=(site.cart, -lag - inertia * acceleration))

    return cause


def cross_coupling(site: Site, rng: np.random.Generator) -> Cause:
    """0.1 mrad by the coordinates of the neighbouring joints: nested wrist gears, belts along the forearm.

    Mostly proportional to the neighbours' coordinates, with a smooth function of them, and a part that also depends on this
    joint's coordinate.
    """
    slopes, field = rng.standard_normal(2), Field.draw(rng, [0.6, 0.6])
    own, part = Field.draw(rng, [0.6, 0.6, 0.6]), rng.uniform(0.05, 0.2)

    def cause(now: ArmSituation) -> Deviation:
        places, cart = now.places, site.cart
        count = places.shape[1]
        near = sorted((j for j in range(count) if j != cart), key=lambda j: (abs(j - cart), -j))[:2]
        others = np.zeros((len(now), 2))
        others[:, : len(near)] = places[:, near]
        both = np.column_stack([others, places[:, cart]])
        return now.driven(site.cart, 1e-4 * (others @ slopes + 0.5 * field(others) + part * own(both)))

    return cause
