"""Deviation along a track that goes with where the other carts are."""

from __future__ import annotations

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

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Slopes and curvatures over the other carts' lead."""
        j = at.robot.sites.index(site)
        lead = np.delete(at.q - at.q[:, [j]], j, axis=1)
        n = lead.shape[1]
        columns = [lead[:, i] for i in range(n)]
        sizes = [1.0] * n
        for a in range(n):
            for b in range(a, n):
                columns.append(lead[:, a] * lead[:, b] / 0.3)
                sizes.append(0.4)
        for i in range(n):
            columns.append(lead[:, i] ** 3 / 0.09)
            sizes.append(0.2)
        return along_track(at, site, np.stack(columns, axis=1), unit(sizes, 2e-4))
