"""Errors of the catalogue on machines without rods: of drives, axes and links, by motion, loads and heat."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.causes.with_rods import hertz
from gtpin.bench.simulator.fields import Field, curve, uneven_curve
from gtpin.bench.simulator.machine import REACH, Deviation
from gtpin.bench.simulator.poses import across
from gtpin.bench.simulator.situation import ArmSituation, Site
from gtpin.typing import Floats


def encoder_scale(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """100 ppm of the coordinate, some of them not constant: pitch of a belt, or lost counts."""
    uneven, part = curve(rng, -REACH, REACH, 0.3), rng.uniform(0.01, 0.03)
    sign, cart = rng.choice([-1.0, 1.0]), site.cart
    return now.off(travel=(cart, sign * 1e-4 * (now.q[:, cart] + part * uneven(now.places[:, cart]))))


def rack_periodic(
    now: ArmSituation, site: Site, rng: np.random.Generator, periods: tuple[float, ...] = ()
) -> Deviation:
    """0.1 mrad: one to three lines of 1 to 100 periods a turn; in half of the cases whole numbers.

    Strain-wave gears have kinematic errors of 0.1 to 0.5 mrad with two periods a turn of the input and neighbouring numbers,
    eccentric encoders one a turn. The amplitudes vary a little over the range, and each line has a weak second harmonic.
    """
    a_turn = np.array(periods)
    if not periods:
        drawn = np.exp(rng.uniform(0.0, np.log(100.0), int(rng.integers(1, 4))))
        a_turn = np.maximum(np.round(drawn), 1.0) if rng.random() < 0.5 else drawn
    lines = len(a_turn)
    sizes = np.array([1.0, *rng.uniform(0.3, 0.9, lines - 1)])
    phases, second = rng.uniform(0.0, 2.0 * np.pi, (2, lines)), rng.uniform(0.0, 0.12, lines)
    swell, depth = curve(rng, -REACH, REACH, 0.4, "twice"), rng.uniform(0.03, 0.15)
    q = now.q[:, site.cart] * (10.0 if now.machine.robot.slides[site.cart] else 1.0)  # a turn: 0.63 m of a rack
    angle = np.multiply.outer(q, a_turn)
    wave = np.sin(angle + phases[0]) + second * np.sin(2.0 * angle + phases[1])
    return now.driven(site.cart, 1e-4 * (wave @ sizes) * (1.0 + depth * swell(now.places[:, site.cart])))


def backlash(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """0.07 mrad to either side (lost motion of strain-wave gears is below 1 arc minute, 0.3 mrad, in all).

    The sum of friction in the last move and load decides the side: a joint with a large load by gravity stays on the side of
    the load; a vertical axis has friction alone. The play is larger where the teeth are worn.
    """
    drag, soft = rng.uniform(1.0, 4.0), rng.uniform(0.05, 0.2)
    wear, worn = rng.uniform(0.03, 0.15), curve(rng, -REACH, REACH, 0.35)
    taken = rng.uniform(0.003, 0.006)  # rad of motion until the friction has changed its sign
    cart, q = site.cart, now.q[:, site.cart]
    usual = now.machine.usual_load(cart)
    friction = drag * now.visits.approach[:, cart] * np.tanh(np.abs(q - now.visits.before[:, cart]) / taken)
    # Friction opposes the move, so the output stays on the side from which the last move came.
    side = np.tanh((now.load(cart) / usual - friction) / soft)
    return now.driven(site.cart, 7e-5 * side * (1.0 + wear * worn(now.places[:, cart])))


def servo_lag(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """0.5 ms times the speed, less at high speed, where feed-forward helps, and a part proportional to the acceleration."""
    saturation, inertia = rng.uniform(0.0, 0.8), rng.uniform(0.5e-5, 2e-5)
    uneven, part = curve(rng, -REACH, REACH, 0.3), rng.uniform(0.0, 0.12)
    speed, acceleration = now.visits.speed[:, site.cart], now.visits.acceleration[:, site.cart]
    lag = 5e-4 * speed / (1.0 + saturation * np.abs(speed)) * (1.0 + part * uneven(now.places[:, site.cart]))
    return now.off(travel=(site.cart, -lag - inertia * acceleration))


def cross_coupling(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """0.1 mrad by the coordinates of the neighbouring joints: nested wrist gears, belts along the forearm.

    Mostly proportional to the neighbours' coordinates, with a smooth function of them, and a part that also depends on this
    joint's coordinate.
    """
    slopes, field = rng.standard_normal(2), Field.draw(rng, [0.6, 0.6])
    own, part = Field.draw(rng, [0.6, 0.6, 0.6]), rng.uniform(0.05, 0.2)
    places, cart = now.places, site.cart
    count = places.shape[1]
    near = sorted((j for j in range(count) if j != cart), key=lambda j: (abs(j - cart), -j))[:2]
    others = np.zeros((len(now), 2))
    others[:, : len(near)] = places[:, near]
    both = np.column_stack([others, places[:, cart]])
    return now.driven(site.cart, 1e-4 * (others @ slopes + 0.5 * field(others) + part * own(both)))


MOTIONS = np.array([2e-5, 2e-5, 7e-6, 5e-5, 5e-5, 0.0])
"""Typical error motions (ISO 230-7): two radial and one axial, m; tilt about two axes across the joint's, rad; no rotation
about it. Cross-roller bearings of small arms have a runout of 5 to 20 um at their diameter of about 0.1 m."""


def axis_motion(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """20 um and 50 urad: the axis shifts and tilts with the joint's angle, slow changes being the largest; some per cent by
    load.

    The error motion is a random smooth periodic function of the angle, not a series of harmonics. A prismatic joint has
    straightness errors and rolls along its guide.
    """
    fields = [Field.draw(rng, [0.8, 0.8]) for _ in range(6)]
    curves = [uneven_curve(rng, -REACH, REACH) for _ in range(6)]
    sizes, phase = rng.uniform(0.4, 1.6, 6), rng.uniform(0.0, 2.0 * np.pi)
    lean, wobble = rng.uniform(0.0, 0.06, 6), Field.draw(rng, [0.5, 0.5])
    cart, machine = site.cart, now.machine
    q, own = now.q[:, cart] + phase, machine.true.joints[machine.robot.counted[cart]].axis
    circle = np.column_stack([np.cos(q), np.sin(q)])
    slides = machine.robot.slides[cart]
    values = np.column_stack([c(now.places[:, cart]) for c in curves] if slides else [f(circle) for f in fields])
    moment = np.linalg.norm(now.borne(cart)[1], axis=1) / machine.usual_load(cart)
    values = values * sizes * (1.0 + lean * np.tanh(moment)[:, None] * wobble(circle)[:, None])
    shape = np.array([2e-5, 2e-5, 0.0, 5e-5, 5e-5, 5e-5]) if slides else MOTIONS
    frame = np.vstack([across(own), own])
    shift, tilt = (values * shape)[:, :3] @ frame, (values * shape)[:, 3:] @ frame
    return now.off(axis=(cart, np.hstack([shift, tilt])))


def bearing_compliance(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """60 urad at the joint's usual moment: a bearing that tilts about the two axes across the joint's axis.

    Cross-roller bearings of strain-wave units have a compliance of 1e-6 to 1e-5 rad/(N m). It decreases with the load, depends
    on the joint's angle, differs between the two axes, and has a small coupling of them.
    """
    exponent, softer = rng.uniform(0.75, 0.95), curve(rng, -REACH, REACH, 0.35)
    give, part = rng.uniform(0.6, 1.4, 2), rng.uniform(0.02, 0.1)
    mixed = rng.uniform(-0.12, 0.12)
    cart, machine = site.cart, now.machine
    j, usual = machine.robot.counted[cart], machine.usual_load(cart)
    own = machine.true.joints[j].axis
    moment = np.einsum("nji,nj->ni", now.bodies.seats[:, j], now.borne(cart)[1])
    carried = moment @ across(own).T / usual
    carried = carried + mixed * carried[:, ::-1]
    tilt = 6e-5 * give * hertz(carried, exponent, 1.0) * (1.0 + part * softer(now.places[:, [cart]]))
    turn = tilt @ across(own)
    return now.off(axis=(cart, np.hstack([np.zeros_like(turn), turn])))


WEIGHT = 3.0 / 8.0
"""Share of a beam's weight that, at the beam's end, deflects the end as much as the distributed weight does."""


def joint_compliance(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """0.15 mrad at the joint's usual torque: wind-up of a gear whose stiffness increases with the torque.

    Strain-wave gears of 5 to 30 kN m/rad wind up by 1 to 3 mrad under 10 to 60 N m; controllers compensate most of it. There is
    some hysteresis by the direction of approach, and the compliance varies over the turn.
    """
    exponent, friction = rng.uniform(0.75, 0.95), rng.uniform(0.0, 0.05)
    softer, part = curve(rng, -REACH, REACH, 0.3), rng.uniform(0.02, 0.08)
    cart = site.cart
    load = now.load(cart) / now.machine.usual_load(cart)
    left = 1.0 - friction * now.visits.approach[:, cart] * np.sign(load)
    give = 1.0 + part * softer(now.places[:, cart])
    return now.driven(cart, 1.5e-4 * left * hertz(load, exponent, 1.0) * give)


def joint_clearance(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """0.07 mrad to either side, reached at about a tenth of the usual load, and 2 um of play in the bearing along the force."""
    seated, wider = rng.uniform(0.03, 0.15), rng.uniform(0.0, 0.1)
    uneven, part = curve(rng, -REACH, REACH, 0.35), rng.uniform(0.01, 0.05)
    cart, machine = site.cart, now.machine
    load = now.load(cart) / machine.usual_load(cart)
    gap = (1.0 + wider * np.tanh(np.abs(load))) * (1.0 + part * uneven(now.places[:, cart]))
    deviation = now.driven(site.cart, 7e-5 * np.tanh(load / seated) * gap)
    force = np.einsum("nji,nj->ni", now.bodies.seats[:, machine.robot.counted[cart]], now.borne(cart)[0])
    deviation.axis[:, cart, :3] = 2e-6 * force / np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-6)
    return deviation


def link_compliance(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """0.1 mrad over a link by the load at its end: bending and torsion of beams, with some compliance at the root of each.

    Aluminium tubes of small arms have E I of 1e4 to 1e5 N m^2. ``arm``: all links have the same cross section. A single link:
    its cross section is made for its load.
    """
    exponent, softer_twist = rng.uniform(0.85, 1.0), rng.uniform(1.2, 1.8)
    each = rng.normal(1.0, 0.1, len(site.rods)).clip(0.6, 1.4)
    root, uneven = rng.uniform(0.0, 0.15, len(site.rods)), rng.uniform(0.85, 1.15, (len(site.rods), 3))
    machine, deviation = now.machine, now.unbent()
    stiffest = min(machine.flexibility(cart) for cart in machine.robot.linked)
    for i, link in enumerate(site.rods):
        if link not in machine.robot.linked:
            continue
        flexibility = each[i] * (stiffest if len(site.rods) > 1 else machine.flexibility(link))
        bent = _beam(now, link, flexibility * uneven[i], softer_twist, root[i], exponent)
        deviation.tip[:, link] = bent
    return deviation


def _beam(
    now: ArmSituation, link: int, flexibility: Floats, softer_twist: float, root: float, exponent: float
) -> Floats:
    """(N, 6) shift, m, and rotation, rad, of a link's end: a cantilever with 1/EI (3,), 1/(N m^2); link's frame."""
    machine = now.machine
    j = machine.robot.counted[link]
    end = machine.robot.next_frame(j).p
    length = machine.robot.length(j)
    spans = float(np.linalg.norm(end)) > 1e-3
    u = end / np.linalg.norm(end) if spans else machine.true.joints[j].axis
    force, moment = now.tip_load(link)
    weight = np.einsum("nji,j->ni", now.bodies.R[:, j], WEIGHT * machine.masses[j] * machine.robot.gravity)
    force = force + weight
    usual = machine.usual_load(link)
    force = usual / length * hertz(force * length / usual, exponent, 3.0)
    moment = usual * hertz(moment / usual, exponent, 3.0)
    lever = np.cross(u, force)
    twisting = np.outer(moment @ u, u)
    turn = flexibility * (length * (moment - twisting + softer_twist * twisting) + 0.5 * length**2 * lever)
    shift = np.cross(flexibility * (0.5 * length**2 * moment + length**3 / 3.0 * lever), u)
    at_root = root * flexibility * length * (moment + length * lever)
    return np.hstack([shift + np.cross(at_root, length * u), turn + at_root])
