"""Backlash: a deviation whose sign depends on the direction of approach."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import drive_load, drive_sizes
from gtpin.effects.effect import ChainWords, Effect, Range
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import carts, number
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import modulated
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


class Backlash(Effect):
    """dq = b approach; dq is the deviation of the actuator's travel from its command q, m (rad where it turns).

    The direction of approach is +1 where the actuator moved towards larger commands before it stopped, and -1 otherwise.
    b < 0: the actuator stops before its command (lost motion). b > 0: it overshoots. The modulation: b varies a little along
    the track and with the load on the actuator.

    Parameters: ``half_width`` b, m (rad where the actuator turns); ``reversal`` = 2 b, m or rad, the reversal error of
    ISO 230-2: the deviation at approach +1 less the deviation at approach -1.

    Typical size 15 um in each direction. The repeatability of the whole Gantry-Tau was 13 um in the mean and 50 um at most,
    over all directions of approach (Dressler et al. 2010, section I, after Crothers et al. 2009). It includes the backlash of
    all drives.
    """

    id = "backlash"
    title = "backlash"
    clause = "{site} has backlash"
    first_checked = True
    of_chains = ChainWords(
        remedy="Check the play of the gear and its preload; approach from one side, or set the drive's backlash compensation."
    )
    remedy = "Check the preload of pinion and gear; approach from one side, or set the drive's backlash compensation."
    coefficient = ("half_width", "m")
    of_travel = True
    between_visits = True
    core = (0,)
    usual: ClassVar[Mapping[str, Range]] = {
        "half_width": Range(-np.inf, 0.0, "a drive that overshoots is rare: the sign of approach may be wrong")
    }

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The actuator's direction of approach."""
        return (f"approach{number(robot, site)}",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """The direction of approach, and its modulation by travel and load."""
        j = at.robot.sites.index(site)
        load = drive_load(at, site)
        approach = at.covariate(f"approach{number(at.robot, site)}")
        columns, size = modulated(approach, [at.travel[:, j], load / 2.0], MODULATION.play)
        return along_track(at, site, columns, drive_sizes(at, site, size, 1.5e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """The half width and the reversal error."""
        half = float(coefficients[0])
        return {"half_width": (half, "m"), "reversal": (2.0 * half, "m")}
