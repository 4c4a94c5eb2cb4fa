"""Play in a spherical joint, taken up by the sign of the link's force."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis, along_track, of_lengths, rods_of
from gtpin.effects.drives import drive_sizes, own_load
from gtpin.effects.effect import ChainWords, Effect, Floats, Range, unit
from gtpin.effects.joint_compliance import loaded
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import joints, links
from gtpin.effects.situation import Situation
from gtpin.effects.untestable import Untestable
from gtpin.robot.robot import Robot

FEWEST = 2
"""Poses that must have the rarer sign of force: a single one looks like a gross error."""


class JointClearance(Effect):
    """dL = c sign(F), F the link's axial force, tension positive: the play lets a link in tension be longer by c than in the
    middle of the play, and shorter by c in compression.

    Where the force is small the joint may float, and with the force its seat yields.

    At a joint of a robot without rods dq = c sign(M), M what the joint carries about its own axis, positive towards larger
    commands: without a covariate of approach, the load decides the side of the play.

    Parameters: ``half_play`` c, m, positive for real play; ``play`` = 2 c, m; ``yielding``, m for every spread of the force
    in the fit: what goes on with the force beyond the play itself.

    Typical size 15 um to either side: a guess for a ball joint that has run in; new ones are preloaded, and have none.
    """

    id = "joint_clearance"
    title = "play in a spherical joint, taken up by the sign of the force"
    clause = "a joint of {site} has play"
    of_chains = ChainWords(
        clause="{site} has play, which its load takes up", remedy="Replace the gear or bearing, or preload it."
    )
    remedy = "Replace or preload the joint."
    coefficient = ("half_play", "m")
    core = (0,)
    of_travel = True
    plausible: ClassVar[Mapping[str, Range]] = {
        "half_play": Range(0.0, np.inf, "play makes a link longer in tension, not shorter")
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Each rod; each counted joint of a robot without rods."""
        return links(robot) or joints(robot)

    def untestable(self, at: Situation, site: str) -> Untestable | None:
        """Play shows only where the force changes its sign."""
        if not at.robot.rods:
            if not loaded(at, site):
                return Untestable("no_load")
            pushed = int((own_load(at, site)[0] > 0.0).sum())
            return None if min(pushed, len(at) - pushed) >= FEWEST else Untestable("one_sign")
        pulled = int((at.force[:, rods_of(at, site)[0]] > 0.0).sum())
        return None if min(pulled, len(at) - pulled) >= FEWEST else Untestable("one_sign")

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it depends on."""
        return ("load",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """The sign of the force, floating where it is small, and yielding."""
        if not at.robot.rods:
            load, (mean, wide) = own_load(at, site)
            spread = max(abs(mean) + wide, 1e-9)
            sign = np.sign(load)
            columns = np.stack([sign, np.tanh(load / (0.2 * spread)) - sign, load / spread], axis=1)
            return along_track(
                at, site, columns, drive_sizes(at, site, [1.0, MODULATION.soft_clearance, MODULATION.yielding], 1.5e-5)
            )
        i = rods_of(at, site)[0]
        sign = np.sign(at.force[:, i])
        spread = at.references.force[1][i]
        soft = np.tanh(at.force[:, i] / (0.2 * spread))
        columns = np.stack([sign, soft - sign, at.force[:, i] / spread], axis=1)
        sizes = [1.0, MODULATION.soft_clearance, MODULATION.yielding]
        return of_lengths(at, [i], columns[:, None, :], unit(sizes, 1.5e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Half the play, the whole, and what goes on with the force."""
        half, yielding = float(coefficients[0]), float(coefficients[2])
        return {"half_play": (half, "m"), "play": (2.0 * half, "m"), "yielding": (yielding, "m")}
