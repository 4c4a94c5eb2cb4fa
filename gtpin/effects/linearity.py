"""Smooth deviation along a track (ISO 230-1: EXX)."""

from __future__ import annotations

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import drive_sizes
from gtpin.effects.effect import ChainWords, Effect, Floats
from gtpin.effects.sites import carts
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines, extent
from gtpin.robot.robot import Robot

ORDERS, DECAY = 14, 1.2
"""Cosines along the track, and how fast their sizes decay; shorter ones would imitate ``rack_periodic``."""


class Linearity(Effect):
    """dq = f(q), smooth, f > 0 where the cart is farther along its track than commanded. ISO 230-1: EXX of a track X.

    f is a sum of cosines over the range of travel whose sizes decay with their order, slow ones the larger.

    Parameters: ``rms`` and ``peak_to_valley`` of f about its straight line over the whole range, m (rad of an arm);
    ``end_to_end``, f at the upper end of the range less f at the lower, m.

    Typical size 50 um. Cart 2 of Dressler et al. 2010 departed from a straight line by 25 to 140 um (section III.C, fig. 5).
    """

    id = "linearity"
    title = "smooth deviation along the track (EXX)"
    clause = "{site} departs smoothly from where it should be along its track"
    of_chains = ChainWords(
        clause="{site} departs smoothly from its command",
        remedy="Load the curve below as a compensation table of the joint, and check how its encoder is mounted.",
    )
    remedy = "Load the curve below as an axis compensation table, or have the rack aligned."
    coefficient = ("first_wave", "m")
    of_travel = True

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Cosines along the track, the slower the larger; the first is nearly the slope that geometry leaves."""
        j = at.robot.sites.index(site)
        columns, size = cosines(at.travel[:, j], 1, ORDERS, DECAY)
        return along_track(at, site, columns, drive_sizes(at, site, size, 5e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """How large the deviation is, about its straight line, and from end to end."""
        rms, span = extent(coefficients)
        ends = -2.0 * float(coefficients[::2].sum())
        return {"rms": (rms, "m"), "peak_to_valley": (span, "m"), "end_to_end": (ends, "m")}
