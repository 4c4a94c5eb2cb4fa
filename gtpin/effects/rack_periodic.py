"""Periodic deviation along a track: a rack's tooth, a pinion's turn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import drive_sizes
from gtpin.effects.effect import ChainWords, Effect, Floats
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import carts, turns
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot

SHORTEST, LONGEST = 0.008, 0.25
"""Periods that are tried, m or rad: from a fine tooth to a large pinion's turn."""

TURN = 2.0 * np.pi
"""One turn, rad: an eccentric encoder's period."""
MOST_A_TURN = 202.0
"""Periods a turn that are tried at most at a turning joint of a chain: a strain wave gear of ratio 101 makes two for each turn
of its input."""
LEAST_TURNS = 1.5
"""Periods that a joint must have gone through: fewer are a linearity."""


class RackPeriodic(Effect):
    """dq = A cos(2 pi q / p - phi), with two harmonics and an amplitude that drifts along the track.

    Parameters: ``period`` p, m (rad of an arm); ``amplitude`` A > 0 at mid-range, m; ``phase`` phi, rad: a crest lies at
    q = p phi / (2 pi); ``harmonic``, amplitude of the second harmonic, m. The period is its nonlinear parameter.

    At a turning joint of a robot without rods, several lines are one cause: gears and encoders have several periods a turn.
    Their parameters are called ``period_2``, ``amplitude_2``, ``phase_2`` and so on. A ``harmonic`` is a line of its own.

    Typical size 20 um. Dressler et al. 2010, section III.C: the manufacturer expects variations with a period of the length
    between the rack's teeth. Precision rack drives are said to run true to 10 um (Machine Design, see ``encoder_scale``).
    """

    id = "rack_periodic"
    title = "periodic deviation along the track"
    clause = "{site} departs periodically along its track"
    remedy = "Look for what has this period: tooth pitch, pinion run-out, mounting; or compensate by the curve below."
    coefficient = ("cosine", "m")
    of_chains = ChainWords(
        clause="{site} departs periodically from its command",
        remedy="Look for what has these periods: an eccentric encoder, a gear, a strain wave; or compensate by the curve below.",
    )
    of_travel = True
    core = (0, 1)
    most_values = 6

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def nonlinear_values(self, at: Situation, site: str) -> Sequence[float]:
        """Periods, so dense that the phase over the whole track is off by at most a twelfth of a turn."""
        q = at.q[:, at.robot.sites.index(site)]
        span = max(float(np.ptp(q)), 1e-9)
        if turns(at.robot, site) and not at.robot.rods:
            longest, shortest = min(TURN, span / LEAST_TURNS), TURN / MOST_A_TURN
        else:
            longest, shortest = min(LONGEST, span / 3.0), SHORTEST
        frequencies = np.arange(1.0 / longest, 1.0 / shortest, 1.0 / (6.0 * span))
        return [float(1.0 / f) for f in frequencies]

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Cosine and sine of the period, their drift along the track, and the first harmonic where it is no line of its own."""
        assert nonlinear is not None
        j = at.robot.sites.index(site)
        phase, x = 2.0 * np.pi * at.q[:, j] / nonlinear, at.travel[:, j]
        c, s = np.cos(phase), np.sin(phase)
        columns, sizes = [c, s, x * c, x * s], [1.0, 1.0, *[MODULATION.line] * 2]
        if at.robot.rods:
            columns += [np.cos(2.0 * phase), np.sin(2.0 * phase)]
            sizes = [1.0, 1.0, *[MODULATION.period] * 4]
        return along_track(at, site, np.stack(columns, axis=1), drive_sizes(at, site, sizes, 2e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Period, amplitude, phase and harmonic."""
        c, s = coefficients[:2]
        found = {
            "period": (float(nonlinear or 0.0), "m"),
            "amplitude": (float(np.hypot(c, s)), "m"),
            "phase": (float(np.arctan2(s, c)), "rad"),
        }
        harmonic = coefficients[4:6]
        return found | ({"harmonic": (float(np.hypot(*harmonic)), "m")} if harmonic.size else {})
