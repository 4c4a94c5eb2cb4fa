"""Runout of a ball joint: the link's length varies with its direction, because the ball is not round."""

from __future__ import annotations

from itertools import product

import numpy as np

from gtpin.effects.basis import Basis, of_lengths, rods_of
from gtpin.effects.effect import Effect, unit
from gtpin.effects.sites import links
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

ORDERS = [(m, n) for m, n in product(range(6), repeat=2) if 1 <= m + n <= 5]
"""Orders (m, n) of the products of cosines over the two angles of a link."""


class JointRunout(Effect):
    """dL = f(a, b); dL is the change of the link's length, m, positive where it is longer.

    a and b are the two small angles, rad, between the link and its mean direction over the poses of the fit. f is a sum of
    products of cosines. Cosines of long wavelength have larger typical sizes. Geometry absorbs the part of f that is constant
    or linear in the angles.

    Parameters: ``rms``, root mean square of f over the range of directions, m; ``largest_wave``, the largest absolute
    coefficient of f, m.

    Typical size 15 um. Balls of grade 100 are round to 2.5 um, of grade 200 to 5 um (ISO 3290). Machined or worn sockets are
    less round.
    """

    id = "joint_runout"
    title = "out-of-round ball"
    clause = "a ball of {site} is out of round"
    remedy = "Have the ball and its socket measured, or replaced."
    coefficient = ("first_wave", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Each link."""
        return links(robot)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The direction of the link."""
        return ("direction",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Products of cosines over the two angles of the link about its mean direction."""
        i = rods_of(at, site)[0]
        a, b = (np.clip(at.tilt[:, i, c] / 2.5, -1.5, 1.5) for c in (0, 1))
        waves = [np.cos(np.pi / 2.0 * m * (a + 1.0)) * np.cos(np.pi / 2.0 * n * (b + 1.0)) for m, n in ORDERS]
        size = np.array([(m + n) ** -1.2 for m, n in ORDERS])
        size *= 2.0 / np.linalg.norm(size)
        return of_lengths(at, [i], np.stack(waves, axis=1)[:, None, :], unit(size, 1.5e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Root mean square of f, and its largest coefficient."""
        # The mean square of a cosine is 1/2, that of a product of two cosines 1/4.
        square = np.array([0.25 if m and n else 0.5 for m, n in ORDERS])
        rms = float(np.sqrt(square @ coefficients**2))
        return {"rms": (rms, "m"), "largest_wave": (float(np.abs(coefficients).max()), "m")}
