"""Deviation along a track that goes with where the other carts are."""

from __future__ import annotations

from itertools import combinations_with_replacement
from math import comb

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import Effect, Floats, carts, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot

AHEAD = 0.3
"""How far another cart may be ahead, m or rad, over which the deviation bends."""
MANY = 2
"""Other actuators beyond which there are no products of more than two of them: they would be too many."""


class CrossCoupling(Effect):
    """dq_j = f(q_k - q_j, q_k), k the other actuators: by how far each is ahead, and by where it is on its own track.

    f is a polynomial of the third degree in the leads, and of the fourth in the places (of the second in both where there are
    many actuators), of which a part grows along the actuator's own track.

    Parameters: ``slope[k]``, m/m, of the k-th of the other actuators in their order: how much farther along its track the
    actuator is where that one is farther along by a metre.

    Typical size 50 um where another cart is 0.3 m ahead: that of the errors along the track of cart 2 in Dressler et al. 2010,
    which at one command varied significantly where the other two carts stood elsewhere (section V; they suppose a lack of
    stiffness).
    """

    id = "cross_coupling"
    title = "deviation along the track that goes with where the other carts are"
    coefficient = ("slope[1]", "m/m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator of a robot with two or more."""
        return carts(robot) if robot.n_actuators > 1 else ()

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it goes with."""
        return tuple(f"q{i + 1}" for i in range(robot.n_actuators))

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Slopes over the others' lead first, then those over their place, then curvatures."""
        j = at.robot.sites.index(site)
        lead = np.delete(at.q - at.q[:, [j]], j, axis=1) / AHEAD
        place = np.delete(at.q - at.robot.home_q, j, axis=1) / (2.0 * AHEAD)
        parts = [_products(lead, 1), _products(place, 1), _products(lead, 2), _products(place, 2)]
        if lead.shape[1] <= MANY:
            parts += [_products(lead, 3), _products(place, 3), _products(place, 4)]
        decays = [1.0, 1.0, 0.4, 0.6, 0.16, 0.36, 0.2]
        size = np.concatenate([np.full(part.shape[1], decay) for part, decay in zip(parts, decays, strict=False)])
        columns, own = np.hstack(parts), at.travel[:, j, None]
        return along_track(at, site, np.hstack([columns, own * columns]), unit(np.append(size, 0.3 * size), 5e-5))

    def parameters(self, coefficients: Floats, setting: float | None) -> dict[str, tuple[float, str]]:
        """Slope over each of the others."""
        others = next(n for n in range(1, len(coefficients) + 1) if 2 * _count(n) >= len(coefficients))
        by_lead, by_place = coefficients[:others] / AHEAD, coefficients[others : 2 * others] / (2.0 * AHEAD)
        return {f"slope[{k + 1}]": (float(slope), "m/m") for k, slope in enumerate(by_lead + by_place)}


def _products(x: Floats, degree: int) -> Floats:
    """(N, m) products of columns of x (N, n), as many as the degree."""
    chosen = combinations_with_replacement(range(x.shape[1]), degree)
    return np.stack([np.prod(x[:, list(columns)], axis=1) for columns in chosen], axis=1)


def _count(others: int) -> int:
    """Number of products of leads and places of so many others."""
    degrees = (1, 1, 2, 2, 3, 3, 4) if others <= MANY else (1, 1, 2, 2)
    return sum(comb(others + degree - 1, degree) for degree in degrees)
