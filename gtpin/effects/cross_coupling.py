"""Deviation along a track that depends on the positions of the other carts."""

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
"""Largest sum of the orders of the cosines in a product, for one and for two other actuators."""
MANY = 2
"""Largest sum of orders for three or more other actuators; a larger sum would give too many products."""
DECAY = 1.5
"""The power p: the size of a product with the sum of orders k is proportional to k^-p."""


class CrossCoupling(Effect):
    """dq_j = f(q_k, q_l, ...), with q_k, q_l, ... the commands of the actuators other than j, and f a smooth function.

    dq_j is the deviation of the travel of actuator j from its command, m (rad where it turns). f is a sum of products of
    cosines over the ranges of travel. The orders of the cosines in a product add up to at most five with two other actuators
    (eight with one, two with more). Products of higher order have smaller typical sizes. The modulation: f also varies along
    the track of actuator j itself.

    Parameters: ``end_to_end[k]``, m (rad where the actuator turns): the mean of f at the upper end of the range of the k-th
    other actuator less its mean at the lower end. The other actuators are counted in the robot's order.

    Typical size 50 um between the ends of the other actuators' ranges. The errors along the track of cart 2 in Dressler et
    al. 2010 are of this size. At one command they varied significantly with the positions of the other two carts (section V;
    the authors assume a lack of stiffness).
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
        """The commands of all actuators."""
        return tuple(f"q{i + 1}" for i in range(robot.n_actuators))

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Cosines over the ranges of the other actuators, products of them, and changes of both along the own track."""
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
        """Change of the mean of f from the lower to the upper end of each other actuator's range."""
        others = next(n for n in range(1, len(coefficients) + 1) if _count(n) >= len(coefficients))
        single = coefficients[: others * _most(others)].reshape(others, -1)
        # A wave of odd order falls from 1 to -1, one of even order ends where it began.
        return {f"end_to_end[{k + 1}]": (-2.0 * float(own[::2].sum()), "m") for k, own in enumerate(single)}


def _most(others: int) -> int:
    return ORDERS.get(others, MANY)


def _orders(others: int) -> tuple[list[tuple[int, ...]], Floats]:
    """Orders of the cosines in each product, and (m,) their sums. Single cosines come first, actuator by actuator."""
    rows = [row for row in product(range(_most(others) + 1), repeat=others) if 1 <= sum(row) <= _most(others)]
    rows.sort(key=lambda row: (sum(o > 0 for o in row) > 1, [-int(o > 0) for o in row], row))
    return rows, np.array([float(sum(row)) for row in rows])


def _count(others: int) -> int:
    """Number of coefficients."""
    sums = _orders(others)[1]
    return len(sums) + int((sums < sums.max()).sum())
