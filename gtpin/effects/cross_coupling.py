"""Deviation along a track that goes with where the other carts are."""

from __future__ import annotations

from itertools import product

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import Effect, carts, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class CrossCoupling(Effect):
    """dq = f(how far each other cart is ahead). In the paper cart 2 shifts along its track with the arm's configuration."""

    id = "cross_coupling"
    title = "deviation along the track that goes with where the other carts are"
    coefficient = ("slope", "m/m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator of a robot with two or more."""
        return carts(robot) if robot.n_actuators > 1 else ()

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it goes with."""
        return tuple(f"q{i + 1}" for i in range(robot.n_actuators))

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Slopes and curvatures over the other carts' lead."""
        j = at.robot.sites.index(site)
        lead = np.delete(at.q - at.q[:, [j]], j, axis=1) / 0.3
        n = lead.shape[1]
        powers = [p for p in product(range(4), repeat=n) if 1 <= sum(p) <= 3]
        columns = np.stack([np.prod(lead**p, axis=1) for p in powers], axis=1)
        own = at.travel[:, j, None]
        # The shift may itself be more at one end of the track than at the other.
        both = np.hstack([columns, own * columns])
        size = np.array([0.4 ** (sum(p) - 1) for p in powers])
        return along_track(at, site, both, unit(np.concatenate([size, 0.3 * size]), 5e-5))
