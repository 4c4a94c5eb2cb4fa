"""Smooth deviation across a track, in both directions (ISO 230-1: EYX, EZX)."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.chain_motions import joint_frame, of_joint
from gtpin.effects.effect import Effect, unit
from gtpin.effects.sites import sliding_carts
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines, extent
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

ORDERS, DECAY = 20, 1.2
"""Number of cosines along the track for each direction, and the power p: the size of order k is proportional to k^-p."""


class Straightness(Effect):
    """dC = f_a(q) a + f_b(q) b, a smooth displacement of the cart, m, the same for all its joints. ISO 230-1: EYX, EZX.

    q is the command. a and b are unit vectors across the track, base frame: the parameters ``track_direction[cart].a`` and
    ``.b`` rotate the track about them. For the Gantry-Tau a points up and b is horizontal, with track x a = b.

    Parameters: ``rms_a``, ``rms_b``, ``peak_to_valley_a``, ``peak_to_valley_b``, m, each after the best straight
    line is subtracted, because a slope belongs to the direction of the track, which is geometry.

    Typical size 40 um. The running parallelism of a rail of a good accuracy class to its base is up to about 30 um over
    2 m (Picard, Understanding Accuracy Classes in Linear Guides). The base itself is probably not straighter.
    """

    id = "straightness"
    nature = "profile"
    title = "track that is not straight"
    clause = "the track of {site} is not straight"
    remedy = "Realign the guideway by the curve below, or use the corrected model."
    coefficient = ("first_wave", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator that slides a carrier along a track."""
        return sliding_carts(robot)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Cosines along the track in two directions across it."""
        j = at.robot.sites.index(site)
        waves, size = cosines(at.travel[:, j], 1, ORDERS, DECAY)
        ways = np.zeros((6, 2))
        ways[:3] = joint_frame(at, site).across.T
        columns = np.broadcast_to(waves[:, None, :], (len(at), 2, waves.shape[1]))
        return of_joint(at, site, ways, columns, unit(np.tile(size, 2), 4e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Root mean square and peak to valley of the deviation in each direction."""
        found: dict[str, tuple[float, str]] = {}
        for direction, part in zip("ab", np.split(coefficients, 2), strict=True):
            rms, span = extent(part)
            found |= {f"rms_{direction}": (rms, "m"), f"peak_to_valley_{direction}": (span, "m")}
        return found
