"""Random commands of an arm: the TCP in front of the base and above the floor, the arm neither folded nor stretched out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.typing import Floats

NEAR, FAR = 0.25, 0.92
"""Smallest distance of the TCP from the vertical axis of the base, and largest from its origin, over the stretched length."""
FLOOR = 0.02
"""Smallest height of joints and TCP above the base, over the stretched length."""
FRONT = 2.0
"""Half the angle of the sector in front of the base, about its x axis, rad."""
RESOLUTION = 1e-6
"""Step to which commands are rounded, rad or m."""
TRIES = 200


def in_front(machine: ArmMachine, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) commands in the used ranges with the arm in front of its base; any commands where hardly any are so."""
    middle, half = machine.region
    found, spare = np.zeros((0, machine.n_carts)), np.zeros((0, machine.n_carts))
    for _ in range(TRIES):
        q = middle + half * rng.uniform(-1.0, 1.0, (count, machine.n_carts))
        q = np.round(q / RESOLUTION) * RESOLUTION
        spare = q
        found = np.vstack([found, q[_sound(machine, q)]])
        if len(found) >= count:
            return found[:count]
    return spare


def _sound(machine: ArmMachine, q: Floats) -> npt.NDArray[np.bool_]:
    robot = machine.robot
    bodies = machine.bodies(q)[0]
    tcp = bodies.at(machine.tcp).T
    whole = robot.reach_from(robot.way[0]) if robot.way else 1.0
    up = -robot.gravity / (float(np.linalg.norm(robot.gravity)) or 1.0)
    heights = np.column_stack([bodies.p[:, j] @ up for j in robot.way[1:]] + [tcp @ up])
    distance = np.linalg.norm(tcp, axis=1)
    sideways = tcp - np.outer(tcp @ up, up)
    ahead = np.abs(np.arctan2(sideways[:, 1], sideways[:, 0])) <= FRONT
    clear = np.linalg.norm(sideways, axis=1) >= NEAR * whole
    return np.asarray((heights > FLOOR * whole).all(axis=1) & (distance < FAR * whole) & clear & ahead)
