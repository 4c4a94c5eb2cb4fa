"""Deviation along a track that depends on the positions of the other carts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations, count, product

import numpy as np

from gtpin.effects.displacement import Displacement, along_track
from gtpin.effects.effect import ChainWords, Effect, Parameters
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import actuators, joints
from gtpin.effects.smooth import drive_sizes, wave
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

ORDERS = {1: 8, 2: 5}
"""Largest sum of the orders of the cosines in a product, for one and for two other actuators."""
ORDERS_OF_MANY = 2
"""Largest sum of orders for three or more other actuators; a larger sum would give too many products."""
SEVERAL_JOINTS = 3
"""Number of other joints of a robot without rods from which on the next numbers hold, in place of ``ORDERS_OF_MANY``."""
SINGLE, PAIR, OWN, NEAREST = 5, 4, 1, 6
"""Largest order of a cosine of one other joint, largest sum of orders of a product of two, largest sum of those that vary
along the own joint, and number of the other joints, the nearest in the robot's order, that form products and vary along the
own joint. What couples joints (gears that pass through each other, belts, cables) lies between two or three of them that follow
each other, so there are no products of three, and none of joints that are far away. Assumed."""
LOWEST = 3
"""Number of lowest cosines that together are nearly proportional to another command, or a beam's bend. Assumed."""
DECAY, STEEP = 1.5, 2.0
"""The power p: the size of a product with the sum of orders k is proportional to k^-p. The second value holds with ``SINGLE``
and ``PAIR``: otherwise the many products of high order would be the largest part of f."""


class CrossCoupling(Effect):
    """dq_j = f(q_k, q_l, ...), with q_k, q_l, ... the commands of the actuators other than j, and f a smooth function.

    dq_j is the deviation of the travel of actuator j from its command, m (rad where it turns). f is a sum of products of
    cosines over the ranges of travel. The orders of the cosines in a product add up to at most five with two other actuators
    (eight with one, two with more). At a robot without rods with three or more other joints, f is a sum of functions of one
    joint (orders up to five) and of two of the six nearest joints (orders that add up to at most four). Products of higher
    order have smaller typical sizes, and so have, without loops, those of far joints: the size is divided by each joint's
    distance, counted in joints. The modulation: f also varies along the track of actuator j itself.

    Parameters: ``end_to_end[k]``, m (rad where the actuator turns): the mean of f at the upper end of the range of the k-th
    other actuator less its mean at the lower end. The other actuators are counted in the robot's order.

    Typical size: root mean square of f 50 um, the size of the errors along the track of cart 2 in Dressler et al. 2010,
    section V: at one command they varied with the positions of the other two carts.
    """

    id = "cross_coupling"
    nature = "description"
    title = "drive error that depends on the other drives"
    clause = "{site} shifts along its track with where the other carts are"
    of_chains = ChainWords(
        clause="{site} departs from its command with where the other joints are",
        remedy="Look at what couples the joints: the gears of a wrist, belts, cables; or use the corrected model.",
    )
    remedy = "Look at what loads or twists the track when the carts move apart: mounting, rack, cart stiffness."
    coefficient = ("first_wave", "m")
    of_travel = True

    def sites(self, robot: Chain) -> tuple[str, ...]:
        return actuators(robot) if robot.n_actuators > 1 else ()

    def coordinates(self, robot: Chain, site: str) -> tuple[str, ...]:
        return tuple(f"q{i + 1}" for i in range(robot.n_actuators))

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        j = at.robot.sites.index(site)
        others = np.delete(at.travel, j, axis=1)
        chosen = _products(others.shape[1], site not in joints(at.robot), j)
        columns = np.stack(
            [np.prod([wave(others[:, k], o) for k, o in enumerate(row) if o], axis=0) for row in chosen.rows], axis=1
        )
        lower = np.array(chosen.along)
        size = np.array([float(sum(row)) for row in chosen.rows]) ** -chosen.decay
        if not at.robot.constraints:  # in a loop the order of the actuators is no distance
            far = [_distance(k, j) for k in range(others.shape[1])]
            size = size / [np.prod([far[k] for k, order in enumerate(row) if order]) for row in chosen.rows]
        size = np.concatenate([size, MODULATION.own_track * size[lower]])
        whole = np.hstack([columns, wave(at.travel[:, [j]], 1) * columns[:, lower]])
        return along_track(at, site, whole, drive_sizes(at, site, 1.5 * size / np.linalg.norm(size), 5e-5))

    def forms(self, robot: Chain, site: str) -> list[list[int]]:
        """The lowest cosines of one other actuator: gears that pass through each other, a beam that another cart bends."""
        chosen = _products(robot.n_actuators - 1, site not in joints(robot), robot.sites.index(site))
        return [[k * chosen.single + order for order in range(LOWEST)] for k in range(chosen.others)]

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        chosen = _with_count(len(coefficients))
        # A wave of odd order falls from 1 to -1; a wave of even order has the same value at both ends.
        single = coefficients[: chosen.others * chosen.single].reshape(chosen.others, -1)
        return {f"end_to_end[{k + 1}]": (-2.0 * float(own[::2].sum()), "m") for k, own in enumerate(single)}


@dataclass(frozen=True)
class _CosineProducts:
    """Products of cosines over the travel of some other actuators.

    - ``others``: number of the other actuators.
    - ``single``: largest order of a cosine alone.
    - ``rows``: orders of the cosines in each product. Single cosines come first, actuator by actuator.
    - ``along``: whether each product varies along the own track.
    - ``decay``: power of the sizes.
    """

    others: int
    single: int
    rows: tuple[tuple[int, ...], ...]
    along: tuple[bool, ...]
    decay: float

    @property
    def count(self) -> int:
        """Number of coefficients."""
        return len(self.rows) + sum(self.along)


@cache
def _products(others: int, rods: bool, own: int = 0) -> _CosineProducts:
    """Products for an actuator with the index ``own``. Their number does not depend on it."""
    fine = not rods and others >= SEVERAL_JOINTS
    single = SINGLE if fine else ORDERS.get(others, ORDERS_OF_MANY)
    together = 2 if fine else single
    nearest = {*sorted(range(others), key=lambda k: _distance(k, own))[: NEAREST if fine else others]}
    rows, along = [], []
    for some in (kept for size in range(1, together + 1) for kept in combinations(range(others), size)):
        near = nearest >= {*some}
        if len(some) > 1 and not near:
            continue
        most = PAIR if fine and len(some) > 1 else single
        for orders in product(range(1, most + 1), repeat=len(some)):
            if sum(orders) <= most:
                rows.append(tuple(dict(zip(some, orders, strict=True)).get(k, 0) for k in range(others)))
                along.append(near and sum(orders) <= (OWN if fine else single - 1))
    return _CosineProducts(others, single, tuple(rows), tuple(along), STEEP if fine else DECAY)


def _distance(other: int, own: int) -> int:
    """Number of joints from the actuator ``own`` to one of the others, counted without it: some come before, some after it."""
    return own - other if other < own else other - own + 1


def _with_count(coefficients: int) -> _CosineProducts:
    """The products of a robot with this number of coefficients: it is different for each number of other actuators."""
    found = (_products(others, rods) for others in count(1) for rods in (True, False))
    return next(chosen for chosen in found if chosen.count == coefficients)
