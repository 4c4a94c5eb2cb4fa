"""A cart gives way, along and across its track, and tips, under the forces of its rods."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis, rods_of
from gtpin.effects.effect import Effect, Floats, Range, unit
from gtpin.effects.hysteresis import approach
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import sliding_carts
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import wave
from gtpin.robot.parameters import rotation_axes
from gtpin.robot.robot import Robot

GIVE = (5e-8, 3e-8, 3e-8)
"""Sizes of the compliances along and across the track, m/N."""
TIP = 5e-7
"""Size of the compliances in turning, rad/(N m)."""
LEVER = 0.1
"""Usual distance of the pull from the mean of the cart's joints, m."""
PLACES = 4
"""Half waves along a track that tell its softer places apart."""
TIPS = 3 * (3 + PLACES)
"""Coefficients of the compliances along and across, before those in turning."""


class CartCompliance(Effect):
    """dC = sum_e c_e (F . e) e + sum_e k_e (M . e) e x (C - m), e the track and the two axes a, b across it.

    F is the rods' pull on the cart (a rod in tension pulls its cart towards the platform) and M its moment about the mean m
    of the cart's joints. Forces come from the closures' Jacobian: gravity of plate, links and payload, the tool's force. The
    cart stiffens with the load, is softer in some places of its track than in others, and friction holds back a little of it.

    Parameters: ``along``, ``across_a``, ``across_b``: c_e, m/N, positive where the cart gives way to the pull; where it
    carries more than one joint ``roll``, ``tip_a``, ``tip_b``: k_e, rad/(N m), positive where it turns with the moment;
    ``stiffening``: by how much ``along`` rises, m/N, as the pull becomes twice the usual, negative where it stiffens.

    Typical size 5e-8 m/N, that is 20 N/um: a guess for rack, gear and servo in series with a carriage on roller blocks, which
    are far stiffer by themselves. Dressler et al. 2010, section V, suppose a lack of stiffness of cart 2.
    """

    id = "cart_compliance"
    title = "the cart gives way and tips under the forces of its links"
    clause = "{site} gives way under the forces of its links"
    remedy = "Check carriage preload and pinion stiffness; use the corrected model with the payload given."
    coefficient = ("along", "m/N")
    exported_as = "cart_springs"
    core = (0, 1, 2)
    plausible: ClassVar[Mapping[str, Range]] = {"along": Range(0.0, np.inf, "no cart moves against its links' pull")}

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator that slides a carrier along a track."""
        return sliding_carts(robot)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it depends on."""
        return ("load", "payload")

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Compliances along and across, their stiffening and their modulation along the track, and compliances in turning."""
        j = at.robot.sites.index(site)
        rods = rods_of(at, site)
        axes = np.roll(rotation_axes(at.robot.actuators[j].axis), 1, axis=0)
        pull = at.force[:, rods, None] * at.along[:, rods]
        force = pull.sum(axis=1)
        lever = at.carrier_joints[:, rods] - at.carrier_joints[:, rods].mean(axis=1, keepdims=True)
        moment = np.cross(lever, pull).sum(axis=1)
        # Against the fit's own load, so that a pose does not depend on which others are predicted with it.
        mean, spread = at.references.force
        usual = max(float(np.sqrt((mean[rods] ** 2 + spread[rods] ** 2).sum())), 1e-9)
        harder = np.linalg.norm(force, axis=1) / usual - 1.0
        softer = [(wave(at.travel[:, j], k), MODULATION.places / k) for k in range(1, PLACES + 1)]
        # Less, and over longer stretches: tipping that changes along the track at will would pass for a track's own twist.
        tips_softer = [(place, MODULATION.tipping * share) for place, share in softer[:2]]
        came = approach(at, j)
        columns, sizes = [], []
        always, stiffening = (np.ones(len(at)), 1.0), MODULATION.stiffening
        for factor, share in [always, (harder, stiffening), (came, MODULATION.friction), *softer]:
            for axis, size in zip(axes, GIVE, strict=True):
                # Friction depends on the magnitude of the pull.
                along = np.abs(force @ axis) if factor is came else force @ axis
                given = (factor * along)[:, None] * axis
                columns.append(np.broadcast_to(given[:, None, :], lever.shape))
                sizes.append(share * size)
        if len(rods) > 1:
            strength = np.linalg.norm(moment, axis=1)
            for factor, share in [always, (strength / (LEVER * usual) - 1.0, stiffening), *tips_softer]:
                for axis in axes:
                    columns.append(np.cross(axis, lever) * (factor * (moment @ axis))[:, None, None])
                    sizes.append(share * TIP)
        carrier_joints = np.zeros((len(at), len(at.robot.rods), 3, len(columns)))
        carrier_joints[:, rods] = np.stack(columns, axis=3)
        return Basis(unit(sizes, 1.0), carrier_joints=carrier_joints)

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Compliances along, across and in turning."""
        names = {"along": 0, "across_a": 1, "across_b": 2, "stiffening": 3}
        found = {name: (float(coefficients[i]), "m/N") for name, i in names.items()}
        tips = coefficients[TIPS : TIPS + 3]
        return found | {n: (float(c), "rad/(N m)") for n, c in zip(("roll", "tip_a", "tip_b"), tips, strict=False)}
