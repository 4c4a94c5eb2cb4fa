"""Errors of the pins of passive joints in machines with loops; unlisted."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.arms.deviation import ArmDeviation
from gtpin.bench.simulator.causes.cause import Cause, Site
from gtpin.bench.simulator.looped.situation import LoopedSituation
from gtpin.bench.simulator.rotations import across


def worn_pin(site: Site, rng: np.random.Generator) -> Cause:
    """A pin with 20 um of play: the force presses it to one side of its hole, and the last move rolls it along the hole's wall.

    A running fit H7/f7 of 10 mm has 13 to 43 um (ISO 286). The worn hole is not round.
    """
    seated, roll = rng.uniform(0.03, 0.15), rng.uniform(0.05, 0.3)
    worn, way = rng.uniform(0.1, 0.5), rng.uniform(0.0, 2.0 * np.pi)

    def cause(now: LoopedSituation) -> ArmDeviation:
        axis = now.machine.joints[site.pin].axis
        force, scale = now.carried_by(site.pin)[0], now.machine.robot.capacity * 9.81
        pressed = np.einsum("nji,nj->ni", now.bodies.seats[:, site.pin], force) @ across(axis).T
        size = np.linalg.norm(pressed, axis=1)
        angle = np.arctan2(pressed[:, 1], pressed[:, 0]) + roll * now.visits.approach[:, 0]
        play = 2e-5 * np.tanh(size / (seated * scale)) * (1.0 + worn * np.cos(2.0 * (angle - way)))
        deviation = now.unbent()
        deviation.seat[:, site.pin, :3] = play[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]) @ across(axis)
        return deviation

    return cause
