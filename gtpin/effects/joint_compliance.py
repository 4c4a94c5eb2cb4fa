"""A joint's drive gives way about its own axis under the joint's load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import own_load
from gtpin.effects.effect import Effect, Floats, Range, unit
from gtpin.effects.hysteresis import approach
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import joints, turns
from gtpin.effects.situation import Situation
from gtpin.effects.untestable import Untestable
from gtpin.robot.robot import Robot

GIVE = {True: 3e-5, False: 5e-8}
"""Size of the compliance of a joint that turns, rad/(N m), and of one that slides, m/N."""


class JointCompliance(Effect):
    """dq = c M, M what the joint carries about its own axis (along it, where it slides): gravity of the links beyond it and of
    the payload, and the force on the tool.

    M is positive where it pulls towards larger commands. The drive stiffens with the load, and friction holds back a little.

    Parameters: ``compliance`` c, rad/(N m) or m/N, positive where the drive gives way to the load; ``stiffening``: by how much
    c rises as the load becomes twice the usual, negative where the drive stiffens; ``hysteresis``: by how much c is larger than
    in the mean where the joint came to rest moving towards larger commands.

    Typical size 3e-5 rad/(N m): a strain wave gear of medium size turns by 1 rad for some 3e4 N m. Of sliding joints 5e-8 m/N,
    as ``cart_compliance`` has it.
    """

    id = "joint_compliance"
    title = "the drive of a joint gives way under the joint's load"
    clause = "the drive of {site} gives way under its load"
    remedy = "Use the corrected model with the payload given; check the gear and its preload."
    coefficient = ("compliance", "rad/(N m)")
    core = (0,)
    plausible: ClassVar[Mapping[str, Range]] = {
        "compliance": Range(0.0, np.inf, "no drive moves against the load that it carries")
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every counted joint of a robot without rods."""
        return joints(robot)

    def untestable(self, at: Situation, site: str) -> Untestable | None:
        """A joint that carries nothing does not give way."""
        return None if loaded(at, site) else Untestable("no_load")

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it depends on."""
        return ("load", "payload")

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """The load, its stiffening, and friction."""
        j = at.robot.sites.index(site)
        load, (mean, spread) = own_load(at, site)
        usual = max(abs(mean) + spread, 1e-9)
        columns = np.stack([load, load * (np.abs(load) / usual - 1.0), np.abs(load) * approach(at, j)], axis=1)
        sizes = [1.0, MODULATION.stiffening, MODULATION.friction]
        return along_track(at, site, columns, unit(sizes, GIVE[turns(at.robot, site)]))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Compliance, and how it depends on the load and on the direction of approach."""
        names = ("compliance", "stiffening", "hysteresis")
        return {name: (float(c), "rad/(N m)") for name, c in zip(names, coefficients, strict=True)}

    def parameters_at(
        self, robot: Robot, site: str, coefficients: Floats, nonlinear: float | None
    ) -> dict[str, tuple[float, str]]:
        """The same, m/N where the joint slides."""
        unit = "rad/(N m)" if turns(robot, site) else "m/N"
        return {name: (value, unit) for name, (value, _) in self.parameters(coefficients, nonlinear).items()}


LEAST_LOAD = 1e-6
"""Load about a joint's own axis, over all that it carries, below which it is rounding."""


def loaded(at: Situation, site: str) -> bool:
    """Whether a joint carries something along or about its own axis at any pose."""
    load, _ = own_load(at, site)
    return bool(np.abs(load).max() > LEAST_LOAD * max(float(np.abs(at.joint_loads).max()), 1e-3))
