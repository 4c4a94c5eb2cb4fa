"""Errors of the catalogue on machines with rods: of drives, guideways, carts, links and joints, by motion, loads and heat."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.fields import Field, curve, uneven_curve
from gtpin.bench.simulator.machine import REACH, Deviation
from gtpin.bench.simulator.situation import STEEL, Postures, RodSituation, Site
from gtpin.typing import Floats


def encoder_scale(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """100 ppm of the travel, some of them not constant along the track."""
    uneven, part = curve(rng, -REACH, REACH, 0.3), rng.uniform(0.015, 0.05)
    sign, cart = rng.choice([-1.0, 1.0]), site.cart
    return now.driven(
        cart, sign * 1e-4 * (now.q[:, cart] + part * 0.35 / now.machine.zoom[cart] * uneven(now.places[:, cart]))
    )


def linearity(now: Postures, site: Site, rng: np.random.Generator, size: float = 3e-5) -> Deviation:
    """30 um; of joints 0.1 mrad (absolute encoders: 20 to 100 arc seconds): smooth, rough in places, sometimes with a step."""
    error = uneven_curve(rng, -REACH, REACH)
    return now.driven(site.cart, size * error(now.places[:, site.cart]))


def rack_periodic(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """20 um with the period of a tooth or a pinion's turn: with harmonics, an amplitude that varies along the track, and in
    half of the cases a jump of the phase where two rack segments meet."""
    tooth = bool(rng.random() < 0.4)
    period = float(np.exp(rng.uniform(np.log(0.012), np.log(0.025)) if tooth else rng.uniform(-2.8, -1.4)))
    phases = rng.uniform(0.0, 2.0 * np.pi, 3)
    strengths = np.array([1.0, rng.uniform(0.05, 0.25), rng.uniform(0.0, 0.12)])
    drift, depth = curve(rng, -REACH, REACH, 0.4, "twice"), rng.uniform(0.05, 0.25)
    joint, jump = rng.uniform(-0.6, 0.6), rng.uniform(-0.5, 0.5) * (rng.random() < 0.5)
    q, place, zoom = now.q[:, site.cart], now.places[:, site.cart], now.machine.zoom[site.cart]
    # A short track has teeth of the same width as a long one, but a smaller pinion.
    turn = 2.0 * np.pi * q / (period if tooth else period / zoom) + jump * (place > joint)
    wave = sum(a * np.sin((k + 1) * turn + p) for k, (a, p) in enumerate(zip(strengths, phases, strict=True)))
    return now.driven(site.cart, 2e-5 * wave * (1.0 + depth * drift(place)))


def rack_step(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """40 um where two rack segments meet: over the width of a tooth. The second segment has a pitch error and is rough."""
    place, width = rng.uniform(-0.42, 0.42), rng.uniform(0.001, 0.008)
    pitch, rough = rng.uniform(-0.25, 0.25), curve(rng, -REACH, REACH, 0.05, "once")
    size, sign = rng.uniform(0.02, 0.08), rng.choice([-1.0, 1.0])
    at = now.places[:, site.cart]
    step = 0.5 * (1.0 + np.tanh((at - place) / width)) + pitch * np.maximum(at - place, 0.0)
    return now.driven(site.cart, sign * 4e-5 * (step + size * rough(at)))


def zero_shift(now: Postures, site: Site, rng: np.random.Generator, size: float = 3e-5) -> Deviation:
    """30 um, of joints 0.1 mrad, between sessions (homing, battery, crash); some per cent settle within 10 min."""
    shifts, settling = rng.standard_normal(20), rng.uniform(0.03, 0.15)
    session, time = now.visits.session, now.visits.time
    since = time - np.array([time[session == s].min() for s in session])
    return now.driven(site.cart, size * shifts[session] * (1.0 - settling * np.exp(-since / 600.0)))


def backlash(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """15 um to either side: smaller under load, larger where the rack is worn, and changing slowly over the day."""
    sign = rng.choice([-1.0, 1.0])
    load, wear, creep = rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.2), rng.uniform(-0.2, 0.2)
    worn = curve(rng, -REACH, REACH, 0.35)
    taken = rng.uniform(0.003, 0.006)  # m of travel until most of the play is taken up
    q, approach = now.q[:, site.cart], now.visits.approach[:, site.cart]
    load_of = np.tanh(np.abs(now.pressing(site.cart)) / 300.0)
    gap = (1.0 - load * load_of) * (1.0 + wear * worn(now.places[:, site.cart]) + creep * now.visits.phase)
    move = np.abs(q - now.visits.before[:, site.cart])
    return now.driven(site.cart, sign * 1.5e-5 * approach * gap * np.tanh(move / taken))


def servo_lag(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """0.2 ms times the speed, less at high speed, where feed-forward helps, and a part proportional to the acceleration."""
    saturation, inertia = rng.uniform(0.0, 0.8), rng.uniform(0.5e-5, 2e-5)
    wear, uneven = rng.uniform(0.0, 0.12), curve(rng, -REACH, REACH, 0.3)
    speed, acceleration = now.visits.speed[:, site.cart], now.visits.acceleration[:, site.cart]
    lag = 2e-4 * speed / (1.0 + saturation * np.abs(speed)) * (1.0 + wear * uneven(now.places[:, site.cart]))
    return now.driven(site.cart, -lag - inertia * acceleration)


def cross_coupling(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """30 um by the positions of the other carts, and a little by that of this cart."""
    field, own = Field.draw(rng, [0.55, 0.55]), Field.draw(rng, [0.5, 0.5, 0.5])
    part, slope = rng.uniform(0.05, 0.25), rng.standard_normal(2)
    others = np.delete(now.places, site.cart, axis=1)[:, :2]
    values = field(others) + others @ slope + part * own(now.places[:, :3])
    return now.driven(site.cart, 2.5e-5 * values)


def straightness(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """30 um in each of two directions across the track; some per cent depend on the load of the cart on its rail."""
    errors = [uneven_curve(rng, -REACH, REACH) for _ in "ab"]
    sizes, load = rng.uniform(0.5, 1.5, 2), rng.uniform(-0.1, 0.1)
    place, across = now.places[:, site.cart], now.machine.across[site.cart]
    pressed = 1.0 + load * np.tanh(now.pull(site.cart)[:, 2] / 300.0)
    deviation = now.unbent()
    for error, size, axis in zip(errors, sizes, across, strict=True):
        deviation.shift[:, site.cart] += (3e-5 * size * pressed * error(place))[:, None] * axis
    return deviation


def cart_rotation(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """60 urad of roll, pitch and yaw, and a smaller rough part."""
    errors = [uneven_curve(rng, -REACH, REACH) for _ in "abc"]
    blocks = [curve(rng, -REACH, REACH, 0.04, "rough") for _ in "abc"]
    sizes, part = rng.uniform(0.4, 1.6, 3), rng.uniform(0.02, 0.12)
    place = now.places[:, site.cart]
    axes = np.vstack([now.machine.across[site.cart], now.machine.tracks[site.cart]])
    angles = [size * (e(place) + part * b(place)) for e, b, size in zip(errors, blocks, sizes, strict=True)]
    return now.off(turn=(site.cart, 6e-5 * np.column_stack(angles) @ axes))


def encoder_slip(now: Postures, site: Site, rng: np.random.Generator, size: float = 2.5e-5) -> Deviation:
    """An encoder's coupling slips at reversals of long moves, to random sides: 25 um, of joints 0.1 mrad; unlisted."""
    slips, hard = rng.standard_normal(4096), rng.uniform(0.5, 0.8)
    approach, moved = now.visits.approach[:, site.cart], np.abs(np.diff(now.q[:, site.cart], prepend=0.0))
    reversal = (np.diff(approach, prepend=0.0) != 0.0) & (moved > np.quantile(moved, hard))
    slipped = np.cumsum(slips[np.arange(len(now)) % len(slips)] * reversal)
    return now.driven(site.cart, size * slipped / np.sqrt(max(int(reversal.sum()), 1) / 3.0))


GIVE = 1e-7
"""Compliance of a cart along its track at small forces, m/N: a rack and pinion of 10 N/um."""
STRETCH = 5e-8
"""Compliance of a link with its two joints at small forces, m/N: 20 N/um."""


def hertz(force: Floats, exponent: float, scale: float) -> Floats:
    """The force (any shape) on a linear spring that deflects as much as a stiffening contact, in the unit of ``force``.

    It is proportional to the force well below ``scale``, and to |force|^``exponent`` well above it.
    """
    return np.asarray(force * (1.0 + (force / scale) ** 2) ** ((exponent - 1.0) / 2.0))


def cart_compliance(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A cart on springs that become stiffer under load: shifts along and across its track, and rotations. The compliance varies
    along the track, and there is some hysteresis."""
    exponent, scale = rng.uniform(0.75, 0.95), rng.uniform(100.0, 400.0)
    give = GIVE * np.array([rng.uniform(0.7, 1.3), *rng.uniform(0.1, 0.6, 2)])
    tip = rng.uniform(0.5, 2.0, 3) * 5e-7  # rad per N m
    softer, part = curve(rng, -REACH, REACH, 0.3), rng.uniform(0.02, 0.1)
    friction = rng.uniform(0.0, 0.05)
    axes = np.vstack([now.machine.tracks[site.cart], now.machine.across[site.cart]])
    soft = (1.0 + part * softer(now.places[:, site.cart]))[:, None]
    force = now.pull(site.cart) @ axes.T
    left = 1.0 + friction * now.visits.approach[:, [site.cart]] * np.sign(force)
    return now.off(
        shift=(site.cart, (soft * left * give * hertz(force, exponent, scale)) @ axes),
        turn=(site.cart, (soft * tip * hertz(now.moment(site.cart) @ axes.T, exponent, scale / 5.0)) @ axes),
    )


def link_compliance(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """Links that stretch, each by its own compliance: stiffer under load and in compression, with some hysteresis."""
    exponent, scale = rng.uniform(0.75, 0.95), rng.uniform(100.0, 400.0)
    give = STRETCH * rng.normal(1.0, 0.12, len(site.rods)).clip(0.6, 1.4)
    harder, friction = rng.uniform(0.0, 0.2), rng.uniform(0.0, 0.05)
    force, drivers = now.forces[:, site.rods], now.machine.driver[list(site.rods)]
    left = 1.0 + friction * now.visits.approach[:, drivers]
    harder_side = np.where(force < 0.0, 1.0 - harder, 1.0)
    return now.off(length=(site.rods, give * left * harder_side * hertz(force, exponent, scale)))


def joint_clearance(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """15 um to either side, reached at some newtons of tension or compression; larger under load, when the joint yields."""
    (rod,) = site.rods
    seated, wider = rng.uniform(2.0, 15.0), rng.uniform(0.02, 0.1)
    uneven, part = Field.draw(rng, [0.3] * 3), rng.uniform(0.01, 0.04)
    force = now.forces[:, rod]
    gap = (1.0 + wider * np.tanh(np.abs(force) / 200.0)) * (1.0 + part * uneven(now.along[:, rod]))
    return now.off(length=(rod, 1.5e-5 * np.tanh(force / seated) * gap))


def joint_runout(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """15 um: balls at the cart and at the platform that are not round. The error changes a little with the load."""
    (rod,) = site.rods
    on_cart, on_plate = Field.draw(rng, [0.25] * 3), Field.draw(rng, [0.25] * 3)
    share, load = rng.uniform(0.0, 0.5), rng.uniform(-0.15, 0.15)
    u = now.along[:, rod]
    out = on_cart(u) + share * on_plate(np.einsum("ni,nij->nj", u, now.poses.R))
    return now.off(length=(rod, 1.5e-5 * out * (1.0 + load * np.tanh(now.forces[:, rod] / 200.0))))


def thermal_links(now: Postures, site: Site, rng: np.random.Generator) -> Deviation:
    """Links, each a little warmer or cooler than the sensor, with a delay, and a factor that changes over the day: of steel; on
    machines without rods of aluminium, each expands from its own joint to the next."""
    count = len(site.rods)
    warmer, delays = rng.normal(1.0, 0.06, count), rng.uniform(0.0, 150.0) + rng.uniform(0.0, 40.0, count)
    local, part = [curve(rng, 0.0, 1.0, 0.25, "twice") for _ in range(count)], rng.uniform(0.01, 0.04)
    visits, deviation = now.visits, now.unbent()
    for i, link in enumerate(site.rods):
        growth = warmer[i] * (visits.day.link_at(visits.time, delays[i]) - visits.day.link[0])
        now.grow(deviation, link, growth * (1.0 + part * local[i](visits.phase)))
    return deviation


def thermal_track(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A steel guideway that expands from a pinned point, restrained by the frame, and warmer at one end."""
    pinned, held = rng.uniform(-1.5, 1.5), rng.uniform(0.6, 1.0)
    delay, uneven = rng.uniform(0.0, 300.0), rng.uniform(-0.15, 0.15)
    local, part = curve(rng, 0.0, 1.0, 0.25, "twice"), rng.uniform(0.02, 0.1)
    visits, q = now.visits, now.q[:, site.cart]
    growth = (visits.day.frame_at(visits.time, delay) - visits.day.frame[0]) * (1.0 + part * local(visits.phase))
    return now.driven(site.cart, held * STEEL * growth * (q - pinned + uneven * (q**2 - pinned**2)))
