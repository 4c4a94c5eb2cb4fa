"""Compliance of a cart: it shifts along and across its track, and turns, under the forces of its rods."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.chain_motions import cart_load, joint_frame, of_body
from gtpin.effects.displacement import Displacement
from gtpin.effects.effect import Effect, ParameterRange, Parameters, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import sliding_actuators
from gtpin.effects.smooth import approach, wave
from gtpin.typing import Floats

GIVE = (5e-8, 3e-8, 3e-8)
"""Typical sizes of the compliances along and across the track, m/N."""
TIP = 5e-7
"""Typical size of the rotational compliances, rad/(N m)."""
LEVER = 0.1
"""Usual distance of the line of action of the force from the mean of the cart's joints, m."""
PLACES = 4
"""Number of cosines that describe how the compliance varies along the track."""
TIPS = 3 * (4 + PLACES)
"""Number of coefficients of the compliances along and across. The rotational compliances follow them."""


class CartCompliance(Effect):
    """dC = sum_e c_e (F . e) e + sum_e k_e (M . e) e x (C - m); dC is the displacement of a joint C of the cart, m.

    The sums are over three unit vectors e: the direction of the track, and a and b across it (see ``straightness``). All
    vectors are in the base frame. F, N, is the sum of the rods' forces on the cart (a rod in tension pulls its cart towards
    the platform). M, N m, is their moment about m, the mean of the cart's joints. The forces are computed with the closures'
    Jacobian from gravity of plate, links and payload, and from the force on the tool. The modulation: the compliances c_e and
    k_e depend on the load and on the place along the track; c_e may differ where F . e is below half of its usual value, as in
    a spring with a dead zone or in a contact. Friction causes a small hysteresis.

    Parameters: ``along``, ``across_a``, ``across_b``: c_e, m/N, at forces that are not small, positive where the cart moves in
    the direction of the force;
    ``stiffening``: by how much ``along`` increases, m/N, when the force becomes twice the usual one, negative where the cart
    becomes stiffer; for a cart with more than one joint also ``roll``, ``tip_a``, ``tip_b``: k_e, rad/(N m), positive where
    the cart turns in the direction of the moment.

    Typical size 5e-8 m/N, that is 20 N/um. It is a guess for rack, gear and servo in series with a carriage on roller blocks.
    The roller blocks alone are much stiffer. Dressler et al. 2010, section V, assume a lack of stiffness of cart 2.
    """

    id = "cart_compliance"
    title = "cart deflection under load"
    clause = "{site} moves and tilts under the forces of its links"
    remedy = "Check carriage preload and pinion stiffness; use the corrected model with the payload given."
    coefficient = ("along", "m/N")
    acts_at = staticmethod(sliding_actuators)
    depends_on = ("load", "payload")
    exported_as = "cart_springs"
    core = (0, 1, 2)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "along": ParameterRange(0.0, np.inf, "no cart moves against its links' pull")
    }

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        """Compliances along and across, modulated by load, friction, place and small forces; then rotational compliances."""
        j = at.robot.sites.index(site)
        frame = joint_frame(at, site)
        rods, axes = list(frame.indices), np.vstack([frame.axis, frame.across])
        force, moment = cart_load(at, site)
        # Relative to the load of the fit, so that a prediction does not depend on which poses are predicted together.
        mean, spread = at.references.force
        usual = max(float(np.sqrt((mean[rods] ** 2 + spread[rods] ** 2).sum())), 1e-9)
        harder = np.linalg.norm(force, axis=1) / usual - 1.0
        softer = [(wave(at.travel[:, j], k), MODULATION.places / k) for k in range(1, PLACES + 1)]
        # Smaller, and with long waves only: otherwise the effect could be confused with a twist of the track.
        tips_softer = [(place, MODULATION.tipping * share) for place, share in softer[:2]]
        came = approach(at, j)
        small = _smallest(at, rods, axes)
        columns, sizes = [], []
        always, stiffening = (np.ones(len(at)), 1.0), MODULATION.stiffening
        for factor, share in [always, (harder, stiffening), (came, MODULATION.friction), *softer]:
            for axis, size in zip(axes, GIVE, strict=True):
                # Friction depends on the magnitude of the pull.
                along = np.abs(force @ axis) if factor is came else force @ axis
                columns.append(np.outer(factor * along, [*axis, 0.0, 0.0, 0.0]))
                sizes.append(share * size)
        for axis, size, least in zip(axes, GIVE, small, strict=True):
            along = force @ axis
            columns.append(np.outer(along / np.sqrt(1.0 + (along / least) ** 2), [*axis, 0.0, 0.0, 0.0]))
            sizes.append(MODULATION.dead_zone * size)
        if len(rods) > 1:
            strength = np.linalg.norm(moment, axis=1)
            for factor, share in [always, (strength / (LEVER * usual) - 1.0, stiffening), *tips_softer]:
                for axis in axes:
                    columns.append(np.outer(factor * (moment @ axis), [0.0, 0.0, 0.0, *axis]))
                    sizes.append(share * TIP)
        return of_body(at, site, np.stack(columns, axis=2), unit(sizes, 1.0))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        names = {"along": 0, "across_a": 1, "across_b": 2, "stiffening": 3}
        found = {name: (float(coefficients[i]), "m/N") for name, i in names.items()}
        tips = coefficients[TIPS : TIPS + 3]
        return found | {n: (float(c), "rad/(N m)") for n, c in zip(("roll", "tip_a", "tip_b"), tips, strict=False)}


def _smallest(at: OperatingPoints, rods: list[int], axes: Floats) -> Floats:
    """(3,) half of the usual pull along each of three axes in the fit, N.

    The usual pull is that of the rods' usual forces in their mean directions.
    """
    (mean, spread), (direction, _) = at.references.force, at.references.direction
    parts = direction[rods] @ axes.T
    usual = np.abs(mean[rods] @ parts) + np.sqrt((spread[rods] ** 2) @ parts**2)
    return np.asarray(np.maximum(usual / 2.0, 1e-9))
