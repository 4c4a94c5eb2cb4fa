"""Deviation along a track that depends on where the other carts are."""

from __future__ import annotations

from itertools import product

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import drive_sizes
from gtpin.effects.effect import ChainWords, Effect, Floats
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import carts
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import wave
from gtpin.robot.robot import Robot

ORDERS = {1: 8, 2: 5}
"""Sum of the orders of waves that are multiplied, by the number of other actuators."""
MANY = 2
"""The same where there are more: products of three and more would be too many."""
DECAY = 1.5
"""How fast sizes decay with that sum."""


class CrossCoupling(Effect):
    """dq_j = f(q_k, q_l, ...), smooth, k, l, ... the other actuators; a part of f changes along the actuator's own track.

    f is a sum of products of cosines over the ranges of travel, of an order of five in all (less where there are many
    actuators), whose sizes decay with their order.

    Parameters: ``end_to_end[k]``, m: difference of the mean of f between the upper and the lower end of the range of the k-th
    other actuator (in their order).

    Typical size 50 um between the ends of the other actuators' ranges. The errors along the track of cart 2 in Dressler et
    al. 2010 are of this size; at one command they varied significantly with the positions of the other two carts (section V;
    the authors suppose a lack of stiffness).
    """

    id = "cross_coupling"
    title = "deviation along the track that depends on where the other carts are"
    clause = "{site} shifts along its track with where the other carts are"
    of_chains = ChainWords(
        clause="{site} departs from its command with where the other joints are",
        remedy="Look at what couples the joints: the gears of a wrist, belts, cables; or use the corrected model.",
    )
    remedy = "Look at what loads or twists the track when the carts move apart: mounting, rack, cart stiffness."
    coefficient = ("first_wave", "m")
    of_travel = True

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator of a robot with two or more."""
        return carts(robot) if robot.n_actuators > 1 else ()

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it depends on."""
        return tuple(f"q{i + 1}" for i in range(robot.n_actuators))

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Waves over each of the others first, then products of them, then changes along the actuator's own track."""
        j = at.robot.sites.index(site)
        others = np.delete(at.travel, j, axis=1)
        chosen, sums = _orders(others.shape[1])
        most = int(sums.max())
        columns = np.stack(
            [np.prod([wave(others[:, k], o) for k, o in enumerate(row) if o], axis=0) for row in chosen], axis=1
        )
        lower = sums < most
        size = np.concatenate([sums**-DECAY, MODULATION.own_track * sums[lower] ** -DECAY])
        whole = np.hstack([columns, wave(at.travel[:, [j]], 1) * columns[:, lower]])
        return along_track(at, site, whole, drive_sizes(at, site, 1.5 * size / np.linalg.norm(size), 5e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """How far each of the others takes the actuator from end to end of its range."""
        others = next(n for n in range(1, len(coefficients) + 1) if _count(n) >= len(coefficients))
        single = coefficients[: others * _most(others)].reshape(others, -1)
        # A wave of odd order falls from 1 to -1, one of even order ends where it began.
        return {f"end_to_end[{k + 1}]": (-2.0 * float(own[::2].sum()), "m") for k, own in enumerate(single)}


def _most(others: int) -> int:
    return ORDERS.get(others, MANY)


def _orders(others: int) -> tuple[list[tuple[int, ...]], Floats]:
    """Orders of the waves in each product, and (m,) their sums; single waves first, actuator by actuator."""
    rows = [row for row in product(range(_most(others) + 1), repeat=others) if 1 <= sum(row) <= _most(others)]
    rows.sort(key=lambda row: (sum(o > 0 for o in row) > 1, [-int(o > 0) for o in row], row))
    return rows, np.array([float(sum(row)) for row in rows])


def _count(others: int) -> int:
    """Number of coefficients."""
    sums = _orders(others)[1]
    return len(sums) + int((sums < sums.max()).sum())
