"""Unlisted errors of machines without rods."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.arm_situation import ArmSituation
from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.fields import Field, curve, play
from gtpin.bench.simulator.machine import REACH
from gtpin.bench.simulator.poses import across


def creep(site: Site, rng: np.random.Generator) -> Cause:
    """A joint that creeps under its load and recovers within minutes: 0.1 mrad, by its earlier loads."""
    constant, memory = rng.uniform(200.0, 1500.0), rng.uniform(0.6, 0.95)

    def cause(now: ArmSituation) -> Deviation:
        load = now.load(site.cart) / now.machine.usual_load(site.cart) + now.visits.payload / now.machine.robot.capacity
        kept = memory * np.exp(-np.diff(now.visits.time, prepend=now.visits.time[0]) / constant)
        crept, wound = 0.0, np.empty(len(now))
        for i, (share, held) in enumerate(zip(kept.tolist(), load.tolist(), strict=True)):
            wound[i] = crept = share * crept + (1.0 - share) * held
        return now.driven(site.cart, 1e-4 * np.sign(wound) * np.abs(wound) ** 1.3)

    return cause


def dress_pack(site: Site, rng: np.random.Generator) -> Cause:
    """A cable bundle along two joints pulls the first of them, by its position and by the path to this position: 0.1 mrad."""
    field, width = Field.draw(rng, [0.5, 0.5]), rng.uniform(0.1, 0.3)
    stick = rng.uniform(0.4, 1.0)

    def cause(now: ArmSituation) -> Deviation:
        places, cart = now.places, site.cart
        other = cart + 1 if cart + 1 < places.shape[1] else max(cart - 1, 0)
        lying = places[:, cart] * places[:, other] + 0.3 * places[:, other]
        dragged = (lying - play(lying, width)) / width
        return now.driven(site.cart, 1e-4 * (field(places[:, [cart, other]]) + stick * dragged))

    return cause


def loose_foot(site: Site, rng: np.random.Generator) -> Cause:
    """A base that lifts off one of its feet when the arm leans to the other side: 0.1 mrad, to one side only, with
    hysteresis."""
    angle, edge = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 0.4)
    lag = rng.uniform(0.02, 0.1)

    def cause(now: ArmSituation) -> Deviation:
        about = np.array([np.cos(angle), np.sin(angle), 0.0])
        leaning = now.leaning @ about
        lifted = np.maximum(play(leaning, lag) - edge, 0.0) ** 1.5
        return now.tilted(2e-4 * lifted, about)

    return cause


def sunny_side(site: Site, rng: np.random.Generator) -> Cause:
    """A motor heats one side of its link, which bends away from it, with a delay: 50 urad per K between link and frame."""
    delay, way = rng.uniform(100.0, 900.0), rng.standard_normal(3)
    (link,) = site.rods

    def cause(now: ArmSituation) -> Deviation:
        machine, day, time = now.machine, now.visits.day, now.visits.time
        warm = day.link_at(time, delay) - day.frame_at(time) + day.frame[0] - day.link[0]
        work = np.cumsum(np.abs(now.q[:, link] - now.visits.before[:, link]))
        warm = warm + 1.5 * np.sin(3.0 * work / max(float(work[-1]), 1e-9))
        turn = np.multiply.outer(5e-5 * warm, way)
        if link not in machine.robot.linked:
            return now.unbent()
        half = 0.5 * machine.robot.next_frame(machine.robot.counted[link]).p
        return now.off(tip=(link, np.hstack([np.cross(turn, half), turn])))

    return cause


def loose_gripper(site: Site, rng: np.random.Generator) -> Cause:
    """A tool that shifts on its flange when it is tilted, and back when it is tilted the other way: 50 um, more with
    payload."""
    ways, width = rng.standard_normal((2, 3)), rng.uniform(0.15, 0.5)
    directions, heavy = rng.standard_normal((2, 3)), rng.uniform(0.5, 2.0)

    def cause(now: ArmSituation) -> Deviation:
        gravity = now.machine.robot.gravity
        down = np.einsum("nji,j->ni", now.poses.R, gravity / (np.linalg.norm(gravity) or 1.0))
        load = 1.0 + heavy * now.visits.payload / now.machine.robot.capacity
        deviation = now.unbent()
        for way, direction in zip(ways, directions, strict=True):
            tilted = down @ direction / np.linalg.norm(direction)
            deviation.target[:] += 5e-5 * (load * play(tilted, width))[:, None] * way
        return deviation

    return cause


def whip(site: Site, rng: np.random.Generator) -> Cause:
    """A link that still vibrates when it is measured: 50 urad, by speed and acceleration of its joint, more when stretched."""
    lean, loose = rng.standard_normal(3), curve(rng, -REACH, REACH, 0.3)
    (link,) = site.rods

    def cause(now: ArmSituation) -> Deviation:
        speed, acceleration = now.visits.speed[:, link], now.visits.acceleration[:, link]
        arm = np.linalg.norm(now.poses.T - now.bodies.p[:, now.machine.robot.counted[link]], axis=1)
        size = (np.tanh(speed / 0.1) + 2.0 * acceleration) * arm * (1.0 + 0.4 * loose(now.places[:, link]))
        turn, shift = 1e-4 * size[:, None] * lean, np.zeros((len(now), 3))
        if now.looped:  # the passive joint there compensates nearly all of a rotation alone
            end = now.machine.robot.next_frame(now.machine.robot.counted[link]).p
            shift = np.cross(turn, 0.5 * end)
        return now.off(tip=(link, np.hstack([shift, turn])))

    return cause


def nest_tilt(site: Site, rng: np.random.Generator) -> Cause:
    """The target rocks in its magnetic nest: 30 um, by the direction of the last move and by the direction of gravity."""
    rock, lean = rng.standard_normal((3, 3)), rng.standard_normal((3, 3))
    sharp, swift = rng.uniform(0.2, 0.5), rng.uniform(0.5, 2.0)

    def cause(now: ArmSituation) -> Deviation:
        came = np.einsum("ni,nij->nj", now.motion, now.poses.R)
        down = -now.poses.R[:, 2]
        moving = 1.0 + swift * np.abs(now.visits.speed).max(axis=1, keepdims=True) / 0.3
        return now.off(target=(..., 3e-5 * (np.tanh(came / sharp) @ rock * moving + np.tanh(3.0 * down @ lean))))

    return cause


def worn_pin(site: Site, rng: np.random.Generator) -> Cause:
    """A pin with 20 um of play: the force presses it to one side of its hole, and the last move rolls it along the hole's wall.

    A running fit H7/f7 of 10 mm has 13 to 43 um (ISO 286). The worn hole is not round.
    """
    seated, roll = rng.uniform(0.03, 0.15), rng.uniform(0.05, 0.3)
    worn, way = rng.uniform(0.1, 0.5), rng.uniform(0.0, 2.0 * np.pi)

    def cause(now: ArmSituation) -> Deviation:
        axis = now.machine.joints[site.pin].axis
        force, scale = now.carried_by(site.pin)[0], now.machine.robot.capacity * 9.81
        pressed = np.einsum("nji,nj->ni", now.bodies.seats[:, site.pin], force) @ across(axis).T
        size = np.linalg.norm(pressed, axis=1)
        angle = np.arctan2(pressed[:, 1], pressed[:, 0]) + roll * now.visits.approach[:, 0]
        play = 2e-5 * np.tanh(size / (seated * scale)) * (1.0 + worn * np.cos(2.0 * (angle - way)))
        shift = play[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]) @ across(axis)
        return now.off(seat=(site.pin, np.hstack([shift, np.zeros_like(shift)])))

    return cause
