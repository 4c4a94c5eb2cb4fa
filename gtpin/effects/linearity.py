"""Smooth deviation along a track (ISO 230-1: EXX)."""

from __future__ import annotations

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import drive_sizes, smooth_cosines
from gtpin.effects.effect import ChainWords, Effect
from gtpin.effects.sites import carts
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import extent
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

ORDERS, DECAY = 20, 1.2
"""Number of cosines along the track, and the power p: the size of order k is proportional to k^-p. Cosines of higher order
would be confused with ``rack_periodic``."""


class Linearity(Effect):
    """dq = f(q), f a smooth function; f > 0 where the cart is farther along its track than commanded. ISO 230-1: EXX.

    dq is the deviation of the travel from the command q, m (rad where the actuator turns). f is a sum of cosines over the
    range of travel. Cosines of long wavelength have larger typical sizes.

    Parameters: ``rms`` and ``peak_to_valley`` of f over the whole range, after the best straight line is subtracted, m (rad
    where the actuator turns); ``end_to_end``, f at the upper end of the range less f at the lower end, in the same unit.

    Typical size 50 um. Cart 2 of Dressler et al. 2010 departed from a straight line by 25 to 140 um (section III.C, fig. 5).
    """

    id = "linearity"
    nature = "profile"
    title = "smooth drive error"
    clause = "{site} departs smoothly from where it should be along its track"
    of_chains = ChainWords(
        clause="{site} departs smoothly from its command",
        remedy="Load the curve below as a compensation table of the joint, and check how its encoder is mounted.",
    )
    remedy = "Load the curve below as an axis compensation table, or have the rack aligned."
    coefficient = ("first_wave", "m")
    of_travel = True
    of_own_command = True

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Cosines along the track. Those of long wavelength are larger; the first is nearly a straight line."""
        j = at.robot.sites.index(site)
        columns, size = smooth_cosines(at, j, ORDERS, DECAY)
        return along_track(at, site, columns, drive_sizes(at, site, size, 5e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Root mean square and peak to valley about the best straight line, and the difference between the ends."""
        rms, span = extent(coefficients)
        ends = -2.0 * float(coefficients[::2].sum())
        return {"rms": (rms, "m"), "peak_to_valley": (span, "m"), "end_to_end": (ends, "m")}
