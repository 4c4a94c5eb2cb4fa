"""Compliance of a joint's bearing: it tilts about the two directions across the joint's axis, under moments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.chain_motions import joint_frame, of_joint
from gtpin.effects.effect import Effect, Range, unit
from gtpin.effects.joint_compliance import no_load
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import joints
from gtpin.effects.situation import Situation
from gtpin.effects.untestable import Untestable
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


class BearingCompliance(Effect):
    """dtheta = k_a (M . a) a + k_b (M . b) b; dtheta is the tilt of the joint's placement frame about its origin, rad.

    M, N m, is the moment on the joint. It is computed from statics: gravity of the links beyond the joint and of the payload,
    and the force on the tool. The unit vectors a and b are perpendicular to the joint's axis. The vectors are in the placement
    frame. The modulation: the compliances k_a and k_b depend on the magnitude of the moment.

    Parameters: ``tilt``, the mean of k_a and k_b, positive where the bearing tilts in the direction of the moment;
    ``difference``, k_a less k_b; ``stiffening``: by how much ``tilt`` increases when the moment becomes twice the usual one,
    negative where the bearing becomes stiffer. All are in rad/(N m).

    Typical size 5e-6 rad/(N m): crossed roller bearings of medium-sized gear units have moment stiffnesses of about
    2e5 N m/rad.
    """

    id = "bearing_compliance"
    title = "bearing deflection under load"
    clause = "the bearing of {site} tilts under load"
    remedy = "Use the corrected model with the payload given; check the bearing's preload and the bolts of its flange."
    coefficient = ("tilt", "rad/(N m)")
    exported_as = "bearing_springs"
    core = (0, 2)
    plausible: ClassVar[Mapping[str, Range]] = {
        "tilt": Range(0.0, np.inf, "no bearing tilts against the moment that it carries")
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuated joint of a robot without rods."""
        return joints(robot)

    def untestable(self, at: Situation, site: str) -> Untestable | None:
        """``no_load`` or ``no_masses`` where the joint carries no load, because an unloaded bearing does not tilt."""
        return None if np.abs(at.joint_loads[:, joint_frame(at, site).index]).max() > 1e-9 else no_load(at)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The load and the payload."""
        return ("load", "payload")

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Tilts about a and b, and how they depend on the magnitude of the moment."""
        frame = joint_frame(at, site)
        moment = at.joint_loads[:, frame.index, 3:] @ frame.across.T
        mean, spread = (values[frame.index, 3:] for values in at.references.joints)
        usual = max(float(np.linalg.norm(mean) + np.linalg.norm(spread)), 1e-9)
        harder = np.linalg.norm(moment, axis=1, keepdims=True) / usual - 1.0
        ways = np.zeros((6, 2))
        ways[3:] = frame.across.T
        return of_joint(
            at, site, ways, np.stack([moment, harder * moment], axis=2), unit([1.0, MODULATION.stiffening] * 2, 5e-6)
        )

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Mean compliance in tilt, the difference between a and b, and the dependence on the load."""
        a, harder_a, b, harder_b = (float(c) for c in coefficients)
        found = {"tilt": (a + b) / 2.0, "difference": a - b, "stiffening": (harder_a + harder_b) / 2.0}
        return {name: (value, "rad/(N m)") for name, value in found.items()}
