"""An out-of-round ball: a link's length varies with its direction."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, of_lengths, rods_of
from gtpin.effects.effect import Effect, links, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class JointRunout(Effect):
    """dL = f(direction of the link), smooth. Precision balls are round to 1 um, worn or cheap ones to 20 um."""

    id = "joint_runout"
    title = "an out-of-round ball: the length varies with the link's direction"
    coefficient = ("curvature", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Each link."""
        return links(robot)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it goes with."""
        return ("direction",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Waves over the two angles of the link about their mean; slopes are geometry's own."""
        i = rods_of(at, site)[0]
        a, b = (np.clip(at.tilt[:, i, c] / 2.5, -1.5, 1.5) for c in (0, 1))
        columns, sizes = [], []
        for m in range(5):
            for n in range(5 - m):
                if m + n >= 1:
                    columns.append(np.cos(np.pi / 2.0 * m * (a + 1.0)) * np.cos(np.pi / 2.0 * n * (b + 1.0)))
                    sizes.append((m + n) ** -1.2)
        size = np.array(sizes) / np.linalg.norm(sizes) * 2.0
        return of_lengths(at, [i], np.stack(columns, axis=1)[:, None, :], unit(size, 1.5e-5))
