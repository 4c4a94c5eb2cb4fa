"""Errors that are in no catalogue: further loads, and errors of the structure."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.causes.with_rods import GIVE, STRETCH
from gtpin.bench.simulator.fields import Field, curve, play
from gtpin.bench.simulator.machine import REACH, Deviation
from gtpin.bench.simulator.poses import across
from gtpin.bench.simulator.situation import ArmSituation, Postures, RodSituation, Site


def hose_drag(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A hose pulls the platform towards its anchor, more at larger distances, and against the last move."""
    anchor = np.array([rng.uniform(-0.8, 0.8), rng.uniform(-0.8, 0.8), rng.uniform(0.8, 2.0)])  # m from home
    seat = rng.uniform(-0.15, 0.15, 3)  # TCP frame, m
    stiffness, drag = rng.uniform(15.0, 50.0), rng.uniform(10.0, 30.0)
    stiffer = Field.draw(rng, [0.4] * 3)
    from_home = now.poses.T - now.machine.home.T[0]
    lever = now.poses.R @ seat
    way = anchor - from_home - lever
    force = stiffness * way * (1.0 + 0.2 * stiffer(from_home))[:, None]
    force -= drag * (1.0 + 0.5 * np.tanh(from_home[:, [0]] / 0.2)) * now.motion
    forces = now.held(np.hstack([force, np.cross(lever, force)]))  # of the rods, which stretch
    travel = np.stack([now.pressing(cart, forces) for cart in range(now.machine.n_carts)], axis=1)
    return now.off(length=(..., STRETCH * forces), travel=(..., GIVE * travel))


def cable_chain(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A cable chain on a cart: it pulls more the longer its hanging part is, sticks to its tray, and tilts the cart."""
    weight, drag = rng.uniform(40.0, 100.0), rng.uniform(30.0, 80.0)  # N
    tray, level = curve(rng, -REACH, REACH, 0.15, "once"), rng.uniform(-0.3, 0.3)
    arm = rng.uniform(-0.3, 0.3, 3)  # m
    cart, place = site.cart, now.places[:, site.cart]
    track = now.machine.tracks[cart]
    hanging = weight * np.logaddexp(0.0, (place - level) / 0.1) * 0.2
    sticking = drag * now.visits.approach[:, cart] * (1.0 + 0.6 * tray(place)).clip(0.1)
    force = (hanging - sticking)[:, None] * track + hanging[:, None] * np.array([0.0, 0.0, -1.0])
    return now.off(shift=(cart, GIVE * force), turn=(cart, 2e-6 * np.cross(arm, force)))


def plate_bending(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A payload off centre bends the platform: its joints shift by 20 um per axis at 20 kg, more than in proportion."""
    ways, exponent = 2e-5 * rng.standard_normal((20, 3)), rng.uniform(1.0, 1.4)
    swing = rng.uniform(0.0, 0.3)
    load = (now.visits.payload / 20.0) ** exponent * (1.0 + swing * now.motion[:, 2])
    return now.off(joint=(..., load[:, None, None] * ways[: len(now.machine.robot.rods)]))


def foot_settling(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """The foot under one end of a track settles in steps, 60 um in all, as the sum of its earlier loads increases."""
    ways, end = rng.standard_normal(3) * np.array([0.4, 0.6, 1.0]), rng.choice([-1.0, 1.0])
    steps = np.sort(rng.uniform(0.1, 0.9, int(rng.integers(3, 7))))
    sizes = rng.exponential(1.0, len(steps))
    sizes /= sizes.sum()
    borne = np.cumsum(np.linalg.norm(now.pull(site.cart), axis=1))
    settled = ((borne / borne[-1])[:, None] > steps) @ sizes
    share = 0.5 * (1.0 + end * now.places[:, site.cart] / REACH)
    return now.off(shift=(site.cart, 6e-5 * (settled * share)[:, None] * ways))


def joint_stick(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A joint that sticks bends its link until it slips: 15 um, by the link's earlier directions, more under load."""
    (rod,) = site.rods
    width, load = rng.uniform(0.05, 0.15), rng.uniform(0.0, 0.5)
    direction = rng.standard_normal(3)
    angle = now.along[:, rod] @ direction / np.linalg.norm(direction)
    bent = (angle - play(angle, width)) / width
    return now.off(length=(rod, -1.5e-5 * bent * (1.0 + load * np.tanh(now.forces[:, rod] / 100.0)) * np.abs(bent)))


def frame_bending(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """The frame bends under the carts' weight: each track shifts by 20 um, as a function of the carts' mean position."""
    sags = [[curve(rng, -REACH, REACH, rng.uniform(0.25, 0.5), "twice") for _ in "ab"] for _ in range(6)]
    twist = Field.draw(rng, [0.4, 0.4])
    mean, spread = now.places.mean(axis=1), now.places[:, 0] - now.places[:, -1]
    deviation = now.unbent()
    for cart, axes in enumerate(now.machine.across):
        for sag, axis in zip(sags[cart], axes, strict=True):
            size = sag(mean) + 0.4 * twist(np.column_stack([mean, spread]))
            deviation.shift[:, cart] += 2e-5 * size[:, None] * axis
    return deviation


def thermal_twist(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A gradient across the frame (links' less frame's temperature) turns and shifts the tracks: 30 urad, 4 um per K."""
    slopes, lifts = rng.standard_normal((6, 2)), rng.standard_normal((6, 2))
    delay = rng.uniform(300.0, 1500.0)
    day, time = now.visits.day, now.visits.time
    gradient = day.link_at(time, 300.0) - day.frame_at(time, delay)
    gradient = gradient + day.frame[0] - day.link[0]
    deviation = now.unbent()
    for cart, axes in enumerate(now.machine.across):
        rise = 3e-5 * now.places[:, [cart]] * slopes[cart] + 4e-6 * lifts[cart]
        deviation.shift[:, cart] = gradient[:, None] * rise @ axes
    return deviation


def nest_tilt(now: Postures, site: Site, rng: np.random.Generator, level: bool = False) -> Deviation:
    """The target rocks in its magnetic nest: 30 um (15 um on a platform that stays almost ``level``), by the direction of the
    last move, more in motion, and by the direction of gravity."""
    rock, lean = rng.standard_normal((3, 3)), rng.standard_normal((3, 3))
    sharp, swift = rng.uniform(0.2, 0.5), rng.uniform(0.5, 2.0)
    came = np.einsum("ni,nij->nj", now.motion, now.poses.R)
    down = -now.poses.R[:, 2]
    moving = 1.0 + swift * np.abs(now.visits.speed).max(axis=1, keepdims=True) / 0.3
    tilted = 20.0 * (down - down[0]) @ lean if level else np.tanh(3.0 * down @ lean)
    return now.off(target=(..., (1.5e-5 if level else 3e-5) * (np.tanh(came / sharp) @ rock * moving + tilted)))


def guide_whip(now: RodSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """Worn guide blocks: the cart shifts across its track by 30 um and turns by 40 urad, by approach and speed."""
    lean, roll = rng.standard_normal(2), rng.standard_normal(3)
    lean /= np.linalg.norm(lean)
    worn = curve(rng, -REACH, REACH, 0.2)
    cart = site.cart
    speed, way = np.abs(now.visits.speed[:, cart]), now.visits.approach[:, cart]
    size = way * (0.3 + np.tanh(speed / 0.1)) * (1.0 + 0.4 * worn(now.places[:, cart]))
    axes = np.vstack([now.machine.across[cart], now.machine.tracks[cart]])
    shift, turn = 3e-5 * size[:, None] * (lean @ axes[:2]), 4e-5 * size[:, None] * (roll @ axes)
    return now.off(shift=(cart, shift), turn=(cart, turn))


def creep(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A joint that creeps under its load and recovers within minutes: 0.1 mrad, by its earlier loads."""
    constant, memory = rng.uniform(200.0, 1500.0), rng.uniform(0.6, 0.95)
    load = now.load(site.cart) / now.machine.usual_load(site.cart) + now.visits.payload / now.machine.robot.capacity
    kept = memory * np.exp(-np.diff(now.visits.time, prepend=now.visits.time[0]) / constant)
    crept, wound = 0.0, np.empty(len(now))
    for i, (share, held) in enumerate(zip(kept.tolist(), load.tolist(), strict=True)):
        wound[i] = crept = share * crept + (1.0 - share) * held
    return now.driven(site.cart, 1e-4 * np.sign(wound) * np.abs(wound) ** 1.3)


def dress_pack(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A cable bundle along two joints pulls the first of them, by its position and by the path to this position: 0.1 mrad."""
    field, width = Field.draw(rng, [0.5, 0.5]), rng.uniform(0.1, 0.3)
    stick = rng.uniform(0.4, 1.0)
    places, cart = now.places, site.cart
    other = cart + 1 if cart + 1 < places.shape[1] else max(cart - 1, 0)
    lying = places[:, cart] * places[:, other] + 0.3 * places[:, other]
    dragged = (lying - play(lying, width)) / width
    return now.driven(site.cart, 1e-4 * (field(places[:, [cart, other]]) + stick * dragged))


def loose_foot(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A base that lifts off a foot when the arm leans to the other side: 0.1 mrad, with hysteresis."""
    angle, edge = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 0.4)
    lag = rng.uniform(0.02, 0.1)
    about = np.array([np.cos(angle), np.sin(angle), 0.0])
    leaning = now.leaning @ about
    lifted = np.maximum(play(leaning, lag) - edge, 0.0) ** 1.5
    return now.tilted(2e-4 * lifted, about)


def sunny_side(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A motor heats one side of its link, which bends away from it, with a delay: 50 urad per K between link and frame."""
    delay, way = rng.uniform(100.0, 900.0), rng.standard_normal(3)
    (link,) = site.rods
    machine, day, time = now.machine, now.visits.day, now.visits.time
    warm = day.link_at(time, delay) - day.frame_at(time) + day.frame[0] - day.link[0]
    work = np.cumsum(np.abs(now.q[:, link] - now.visits.before[:, link]))
    warm = warm + 1.5 * np.sin(3.0 * work / max(float(work[-1]), 1e-9))
    turn = np.multiply.outer(5e-5 * warm, way)
    if link not in machine.robot.linked:
        return now.unbent()
    half = 0.5 * machine.robot.next_frame(machine.robot.counted[link]).p
    return now.off(tip=(link, np.hstack([np.cross(turn, half), turn])))


def loose_gripper(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A tool that shifts on its flange when tilted, and back when tilted the other way: 50 um, more with payload."""
    ways, width = rng.standard_normal((2, 3)), rng.uniform(0.15, 0.5)
    directions, heavy = rng.standard_normal((2, 3)), rng.uniform(0.5, 2.0)
    gravity = now.machine.robot.gravity
    down = np.einsum("nji,j->ni", now.poses.R, gravity / (np.linalg.norm(gravity) or 1.0))
    load = 1.0 + heavy * now.visits.payload / now.machine.robot.capacity
    deviation = now.unbent()
    for way, direction in zip(ways, directions, strict=True):
        tilted = down @ direction / np.linalg.norm(direction)
        deviation.target[:] += 5e-5 * (load * play(tilted, width))[:, None] * way
    return deviation


def whip(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A link that still vibrates when it is measured: 50 urad, by speed and acceleration of its joint, more when stretched."""
    lean, loose = rng.standard_normal(3), curve(rng, -REACH, REACH, 0.3)
    (link,) = site.rods
    speed, acceleration = now.visits.speed[:, link], now.visits.acceleration[:, link]
    arm = np.linalg.norm(now.poses.T - now.bodies.p[:, now.machine.robot.counted[link]], axis=1)
    size = (np.tanh(speed / 0.1) + 2.0 * acceleration) * arm * (1.0 + 0.4 * loose(now.places[:, link]))
    turn, shift = 1e-4 * size[:, None] * lean, np.zeros((len(now), 3))
    if now.looped:  # the passive joint there compensates nearly all of a rotation alone
        end = now.machine.robot.next_frame(now.machine.robot.counted[link]).p
        shift = np.cross(turn, 0.5 * end)
    return now.off(tip=(link, np.hstack([shift, turn])))


def worn_pin(now: ArmSituation, site: Site, rng: np.random.Generator) -> Deviation:
    """A pin with 20 um of play: the force presses it to one side of its hole, and the last move rolls it along the hole's wall.

    A running fit H7/f7 of 10 mm has 13 to 43 um (ISO 286). The worn hole is not round.
    """
    seated, roll = rng.uniform(0.03, 0.15), rng.uniform(0.05, 0.3)
    worn, way = rng.uniform(0.1, 0.5), rng.uniform(0.0, 2.0 * np.pi)
    axis = now.machine.true.joints[site.pin].axis
    force, scale = now.carried_by(site.pin)[0], now.machine.robot.capacity * 9.81
    pressed = np.einsum("nji,nj->ni", now.bodies.seats[:, site.pin], force) @ across(axis).T
    size = np.linalg.norm(pressed, axis=1)
    angle = np.arctan2(pressed[:, 1], pressed[:, 0]) + roll * now.visits.approach[:, 0]
    play = 2e-5 * np.tanh(size / (seated * scale)) * (1.0 + worn * np.cos(2.0 * (angle - way)))
    shift = play[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]) @ across(axis)
    return now.off(seat=(site.pin, np.hstack([shift, np.zeros_like(shift)])))
