"""Smooth roll, pitch and yaw of a cart along its track (ISO 230-1: EAX, EBX, ECX)."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, rods_of
from gtpin.effects.effect import Effect, unit
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines
from gtpin.robot.robot import Robot


class CartRotation(Effect):
    """dC = w(q) x (C - the mean of the cart's joints). A cart with one joint turns unseen."""

    id = "cart_rotation"
    title = "smooth roll, pitch and yaw of the cart along the track (EAX, EBX, ECX)"
    coefficient = ("first_wave", "rad")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator that slides a carrier along a track."""
        carried = {rod.carrier for rod in robot.rods if rod.carrier is not None}
        return tuple(s for i, s in enumerate(robot.sites) if i in carried and not robot.actuators[i].revolute)

    def untestable(self, at: Situation, site: str) -> str:
        """A single joint does not move when its cart turns about it."""
        return "" if len(rods_of(at, site)) > 1 else "the cart carries a single joint, about which it turns unseen"

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Cosines along the track about three axes."""
        j = at.robot.sites.index(site)
        rods = rods_of(at, site)
        waves, size = cosines(at.travel[:, j], 1, 7, 1.2)
        lever = at.seats[:, rods] - at.seats[:, rods].mean(axis=1, keepdims=True)
        m = waves.shape[1]
        seat = np.zeros((len(at), len(at.robot.rods), 3, 3 * m))
        for a, axis in enumerate(np.eye(3)):
            arm = np.cross(axis, lever)
            seat[:, rods, :, a * m : (a + 1) * m] = arm[..., None] * waves[:, None, None, :]
        return Basis(unit(np.tile(size, 3), 1e-4), seat=seat)
