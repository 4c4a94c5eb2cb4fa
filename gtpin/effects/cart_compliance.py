"""A cart gives way, along and across its track, and tips, under the forces of its rods."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, rods_of
from gtpin.effects.effect import Effect, unit
from gtpin.effects.situation import Situation
from gtpin.robot.parameters import rotation_axes
from gtpin.robot.robot import Robot


class CartCompliance(Effect):
    """dC = c F along and across the track, and a turn in proportion to the moment. Carts on rollers: 5 to 50 N/um."""

    id = "cart_compliance"
    title = "the cart gives way and tips under the forces of its links"
    coefficient = ("along", "m/N")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator that slides a carrier along a track."""
        carried = {rod.carrier for rod in robot.rods if rod.carrier is not None}
        return tuple(s for i, s in enumerate(robot.sites) if i in carried and not robot.actuators[i].revolute)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it goes with."""
        return ("load", "payload")

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Compliances along and in two directions across the track, about three axes, and stiffening along."""
        j = at.robot.sites.index(site)
        rods = rods_of(at, site)
        axis = at.robot.actuators[j].axis
        # A rod in tension pulls its cart along the rod, towards the platform.
        pull = at.force[:, rods, None] * at.along[:, rods]
        force = pull.sum(axis=1)
        lever = at.seats[:, rods] - at.seats[:, rods].mean(axis=1, keepdims=True)
        moment = np.cross(lever, pull).sum(axis=1)
        axes = np.vstack([axis, rotation_axes(axis)[:2]])
        columns, sizes = [], []
        for number, direction in enumerate(axes):
            given = (force @ direction)[:, None] * direction
            columns.append(np.broadcast_to(given[:, None, :], lever.shape))
            sizes.append(5e-8 if number == 0 else 3e-8)
        magnitude = np.linalg.norm(force, axis=1)
        stiffening = (magnitude / max(float(magnitude.mean()), 1e-9) - 1.0)[:, None]
        columns.append(np.broadcast_to(((force @ axis)[:, None] * stiffening * axis)[:, None, :], lever.shape))
        sizes.append(1e-8)
        if len(rods) > 1:
            for direction in axes:
                columns.append(np.cross(direction, lever) * (moment @ direction)[:, None, None])
                sizes.append(5e-7)
        seat = np.zeros((len(at), len(at.robot.rods), 3, len(columns)))
        seat[:, rods] = np.stack(columns, axis=3)
        return Basis(unit(sizes, 1.0), seat=seat)
