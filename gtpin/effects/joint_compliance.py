"""Compliance of a joint's drive: the joint deflects about its own axis under its load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import own_load
from gtpin.effects.effect import Effect, Range, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import joints, turns
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import approach
from gtpin.effects.untestable import Untestable
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

GIVE = {True: 3e-5, False: 5e-8}
"""Typical size of the compliance of a joint that turns, rad/(N m), and of a joint that slides, m/N."""


class JointCompliance(Effect):
    """dq = c M; dq is the deviation of the joint from its command, rad (m where it slides), and M the load on the joint.

    M is the moment about the joint's axis, N m. For a sliding joint it is the force along the axis, N. It comes from gravity of
    the links beyond the joint and of the payload, and from the force on the tool. M is positive where it acts towards larger
    commands. The modulation: c depends on the load, and friction causes a small hysteresis.

    Parameters: ``compliance`` c, positive where the joint moves in the direction of the load; ``stiffening``: by how much c
    increases when the load becomes twice the usual one, negative where the drive becomes stiffer; ``hysteresis``: c less its
    mean, where the joint moved towards larger commands before it stopped. All are in rad/(N m), or in m/N where the joint
    slides. The usual load is the absolute mean over the poses of the fit plus one standard deviation.

    Typical size 3e-5 rad/(N m): the stiffness of a medium-sized strain wave gear is about 3e4 N m/rad. For sliding joints
    5e-8 m/N, as in ``cart_compliance``.
    """

    id = "joint_compliance"
    title = "drive deflection under load"
    clause = "the drive of {site} deflects under its load"
    remedy = "Use the corrected model with the payload given; check the gear and its preload."
    coefficient = ("compliance", "rad/(N m)")
    exported_as = "joint_spring"
    core = (0,)
    plausible: ClassVar[Mapping[str, Range]] = {
        "compliance": Range(0.0, np.inf, "no drive moves against the load that it carries")
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuated joint of a robot without rods."""
        return joints(robot)

    def untestable(self, at: Situation, site: str) -> Untestable | None:
        """``no_load`` or ``no_masses`` where the joint carries no load, because it then has no deflection."""
        return None if loaded(at, site) else no_load(at)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The load and the payload."""
        return ("load", "payload")

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """The load, its modulation by stiffening, and hysteresis from friction."""
        j = at.robot.sites.index(site)
        load, (mean, spread) = own_load(at, site)
        usual = max(abs(mean) + spread, 1e-9)
        columns = np.stack([load, load * (np.abs(load) / usual - 1.0), np.abs(load) * approach(at, j)], axis=1)
        sizes = [1.0, MODULATION.stiffening, MODULATION.friction]
        return along_track(at, site, columns, unit(sizes, GIVE[turns(at.robot, site)]))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """The compliance, and its dependence on the load and on the direction of approach."""
        names = ("compliance", "stiffening", "hysteresis")
        return {name: (float(c), "rad/(N m)") for name, c in zip(names, coefficients, strict=True)}

    def parameters_at(
        self, robot: Robot, site: str, coefficients: Floats, nonlinear: float | None
    ) -> dict[str, tuple[float, str]]:
        """The same parameters, in m/N where the joint slides."""
        unit = "rad/(N m)" if turns(robot, site) else "m/N"
        return {name: (value, unit) for name, (value, _) in self.parameters(coefficients, nonlinear).items()}


LEAST_LOAD = 1e-6
"""Smallest load on a joint's own axis, relative to the largest load on any joint. Smaller loads are rounding errors."""


def loaded(at: Situation, site: str) -> bool:
    """Whether a joint has a force along its axis, or a moment about it, at any pose."""
    load, _ = own_load(at, site)
    return bool(np.abs(load).max() > LEAST_LOAD * max(float(np.abs(at.joint_loads).max()), 1e-3))


def no_load(at: Situation) -> Untestable:
    """Why a joint carries nothing: ``no_masses`` where no joint carries anything at any pose, else ``no_load``."""
    return Untestable("no_load" if at.joint_loads.any() else "no_masses")
