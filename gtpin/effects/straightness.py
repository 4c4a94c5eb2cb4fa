"""Smooth deviation across a track, in both directions (ISO 230-1: EYX, EZX)."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, rods_of
from gtpin.effects.effect import Effect, unit
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines
from gtpin.robot.parameters import rotation_axes
from gtpin.robot.robot import Robot


class Straightness(Effect):
    """dC = f(q) across the track, smooth, the same for all joints of the cart. Guideways: 10 to 100 um over a metre."""

    id = "straightness"
    title = "smooth deviation across the track (EYX, EZX)"
    coefficient = ("first_wave", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator that slides a carrier along a track."""
        carried = {rod.carrier for rod in robot.rods if rod.carrier is not None}
        return tuple(s for i, s in enumerate(robot.sites) if i in carried and not robot.actuators[i].revolute)

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Cosines along the track in two directions across it."""
        j = at.robot.sites.index(site)
        waves, size = cosines(at.travel[:, j], 1, 10, 1.2)
        across = rotation_axes(at.robot.actuators[j].axis)[:2]
        m = waves.shape[1]
        seat = np.zeros((len(at), len(at.robot.rods), 3, 2 * m))
        for a, axis in enumerate(across):
            for i in rods_of(at, site):
                seat[:, i, :, a * m : (a + 1) * m] = axis[None, :, None] * waves[:, None, :]
        return Basis(unit(np.tile(size, 2), 4e-5), seat=seat)
