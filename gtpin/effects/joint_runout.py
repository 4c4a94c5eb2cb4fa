"""An out-of-round ball: a link's length varies with its direction."""

from __future__ import annotations

from itertools import product

import numpy as np

from gtpin.effects.basis import Basis, of_lengths, rods_of
from gtpin.effects.effect import Effect, Floats, unit
from gtpin.effects.sites import links
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot

ORDERS = [(m, n) for m, n in product(range(6), repeat=2) if 1 <= m + n <= 5]
"""Of the waves over the two angles of a link."""


class JointRunout(Effect):
    """dL = f(a, b), a and b the two small angles of the link about its mean direction in the fit: f > 0 makes it longer.

    f is a sum of products of cosines, slow ones the larger. What is constant or linear in the angles is geometry.

    Parameters: ``rms`` of f over the range of directions, m; ``largest_wave``, the largest of its coefficients, m.

    Typical size 15 um. Balls of grade 100 are round to 2.5 um, of grade 200 to 5 um (ISO 3290); seats that were turned or
    worn are not so round.
    """

    id = "joint_runout"
    title = "an out-of-round ball: the length varies with the link's direction"
    clause = "a ball of {site} is out of round"
    remedy = "Have the ball and its socket measured, or replaced."
    coefficient = ("first_wave", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Each link."""
        return links(robot)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it depends on."""
        return ("direction",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Waves over the two angles of the link about their mean; slopes are geometry's own."""
        i = rods_of(at, site)[0]
        a, b = (np.clip(at.tilt[:, i, c] / 2.5, -1.5, 1.5) for c in (0, 1))
        waves = [np.cos(np.pi / 2.0 * m * (a + 1.0)) * np.cos(np.pi / 2.0 * n * (b + 1.0)) for m, n in ORDERS]
        size = np.array([(m + n) ** -1.2 for m, n in ORDERS])
        size *= 2.0 / np.linalg.norm(size)
        return of_lengths(at, [i], np.stack(waves, axis=1)[:, None, :], unit(size, 1.5e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """How far the joint is from round."""
        # A cosine's mean square is a half, a product's of two a quarter.
        square = np.array([0.25 if m and n else 0.5 for m, n in ORDERS])
        rms = float(np.sqrt(square @ coefficients**2))
        return {"rms": (rms, "m"), "largest_wave": (float(np.abs(coefficients).max()), "m")}
