"""Play in a spherical joint, taken up by the sign of the link's force."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, of_lengths, rods_of
from gtpin.effects.effect import Effect, links, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot

SURE = 0.02
"""Least share of the poses that must have the rarer sign of force."""


class JointClearance(Effect):
    """dL = c sign(F). A worn ball joint: 5 to 50 um."""

    id = "joint_clearance"
    title = "play in a spherical joint, taken up by the sign of the force"
    coefficient = ("half_play", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Each link."""
        return links(robot)

    def untestable(self, at: Situation, site: str) -> str:
        """Play shows only where the force changes its sign."""
        pull = (at.force[:, rods_of(at, site)[0]] > 0.0).mean()
        return "" if SURE <= pull <= 1.0 - SURE else "the link's force does not change its sign"

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it goes with."""
        return ("load",)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """The sign of the force, and its bend with the size of the force."""
        i = rods_of(at, site)[0]
        sign = np.sign(at.force[:, i])
        spread = at.references.force[1][i]
        soft = np.tanh(at.force[:, i] / (0.2 * spread))
        columns = np.stack([sign, soft - sign, at.force[:, i] / spread], axis=1)
        return of_lengths(at, [i], columns[:, None, :], unit([1.0, 0.3, 0.15], 1.5e-5))
