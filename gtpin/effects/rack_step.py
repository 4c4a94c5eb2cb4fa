"""A step where two rack segments meet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import ChainWords, Effect, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import tracks
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

FEWEST = 3
"""Smallest number of commands beyond a step: with fewer it can't be distinguished from a gross error."""
FLANKS = (0.01, 0.03)
"""Widths of the ramps that describe a flank, m. Assumed: two teeth of a pinion are in mesh, so that the cart passes from one
segment to the other over two pitches, which are 5 to 16 mm long for a module of 1.5 to 5 mm. Where the actuator turns, the same
numbers in rad are assumed."""


class RackStep(Effect):
    """dq = h + m (q - p) where q > p, otherwise 0; dq is the deviation of the travel from the command q, m.

    p is the command at which the second rack segment begins. Beyond it, the cart is farther along its track by h. The
    modulation: the second segment has a pitch error m, so the deviation changes linearly with q; and the step has a flank,
    because the pinion passes from one segment to the other over some millimetres. The flank is a sum of ramps r_w with their
    middle at p, of widths w = 10 and 30 mm: dq has the further terms f_w (r_w - 1) where q > p, f_w r_w where q < p. They are
    zero at a distance of w / 2 and more.

    Parameters: ``place`` p, m, the nonlinear parameter: the middle of the flank; ``step`` h, m, the whole height, positive
    where the cart is farther than commanded beyond the place; ``slope`` m, m/m, the pitch error of the second segment. Where
    the actuator turns, rad replaces m.

    Typical size 50 um. Segments of precision racks that are checked and matched have position errors of at most 40 um over
    any length (Machine Design, see ``encoder_scale``).
    """

    id = "rack_step"
    title = "step in the drive"
    clause = "{site} steps where two rack segments meet"
    of_chains = ChainWords(
        clause="the travel of {site} has a step", remedy="Check the scale or rack at the place below, and its joint."
    )
    remedy = "Check the joint of the rack's segments at the place below, and its gap gauge."
    coefficient = ("step", "m")
    of_travel = True
    of_own_command = True
    core = (0,)

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator of a robot with rods."""
        return tracks(robot)

    def nonlinear_values(self, at: Situation, site: str) -> Sequence[float]:
        """Places to try: the middle between neighbouring commands, except near the ends of the track."""
        q = np.unique(at.q[:, at.robot.sites.index(site)])
        between = (q[1:] + q[:-1]) / 2.0
        edge = max(FEWEST - 1, len(between) // 100)
        inner = between[edge:-edge]
        return [float(place) for place in inner[:: max(1, len(inner) // 100)]]

    def jumps(self, nonlinear: float | None) -> tuple[float, ...]:
        """The place of the step."""
        return () if nonlinear is None else (nonlinear,)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """The step, a slope beyond it, and ramps less the step, which make its flank wider."""
        assert nonlinear is not None
        j = at.robot.sites.index(site)
        past = at.q[:, j] - nonlinear
        beyond = (past > 0.0).astype(float)
        flanks = [np.clip(0.5 + past / width, 0.0, 1.0) - beyond for width in FLANKS]
        span = at.robot.upper[j] - at.robot.lower[j]
        sizes = [1.0, MODULATION.slope / span, *[MODULATION.flank] * len(FLANKS)]
        return along_track(at, site, np.stack([beyond, beyond * past, *flanks], axis=1), unit(sizes, 5e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Place and height of the step, and the slope beyond."""
        step, slope = (float(c) for c in coefficients[:2])
        return {"place": (float(nonlinear or 0.0), "m"), "step": (step, "m"), "slope": (slope, "m/m")}
