"""Links stretch under load."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, of_lengths, rods_of
from gtpin.effects.effect import Effect, arm_and_links, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class LinkCompliance(Effect):
    """dL = c F. Two metres of steel or carbon tube and two ball joints: 10 to 50 N/um."""

    id = "link_compliance"
    title = "links stretch under load"
    coefficient = ("compliance", "m/N")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """All links together, and each."""
        return arm_and_links(robot)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it goes with."""
        return ("load", "payload")

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """One compliance, what each link differs by, and stiffening with the load."""
        rods = rods_of(at, site)
        force = at.force[:, rods]
        stiffening = (
            force
            * np.abs(force)
            / np.maximum(np.abs(at.references.force[0][rods]) + at.references.force[1][rods], 1e-9)
        )
        columns = [force, stiffening]
        sizes = [1.0, 0.2]
        if len(rods) > 1:
            columns += [force * (np.arange(len(rods)) == i) for i in range(len(rods))]
            sizes += [0.2] * len(rods)
        return of_lengths(at, rods, np.stack(columns, axis=2), unit(sizes, 4e-8))
