"""Periodic deviation along a track, with the period of a rack's tooth or of a pinion's turn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import drive_sizes
from gtpin.effects.effect import ChainWords, Effect
from gtpin.effects.modulation import MODULATION
from gtpin.effects.sites import carts, joints, turns
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

SHORTEST, LONGEST = 0.008, 0.25
"""Shortest and longest period that is tried, m or rad: a fine tooth, and one turn of a large pinion."""

TURN = 2.0 * np.pi
"""One turn, rad: the period of an eccentric encoder."""
MOST_A_TURN = 202.0
"""Largest number of periods per turn that is tried at a turning joint of a robot without rods. A strain wave gear of ratio 101
has two periods for each turn of its input."""
LEAST_TURNS = 1.5
"""Smallest number of periods in the joint's range of commands. With fewer the deviation is a ``linearity``, unless the joint
has another period as well."""
APART = 0.5
"""Smallest difference of two periods of one joint, in cycles over its range of commands. Derived: the Fourier resolution is one
cycle; at half of it, the cosines of two periods have a correlation of sin(pi / 2) / (pi / 2) = 0.64. Nearer ones are one line
whose amplitude changes, or no line."""


class RackPeriodic(Effect):
    """dq = A cos(2 pi q / p - phi); dq is the deviation of the travel from the command q, m (rad where the actuator turns).

    The modulation: amplitude and phase change along the track (linearly and quadratically for robots with rods), and the
    deviation has a second harmonic, with the period p / 2.

    Parameters: ``period`` p, m, the nonlinear parameter; ``amplitude`` A > 0 at the middle of the range, m; ``phase`` phi,
    rad: the deviation has a maximum at q = p phi / (2 pi); ``harmonic``, amplitude of the second harmonic, m. Where the
    actuator turns, rad replaces m.

    At a turning joint of a robot without rods, one cause can have several periods, because gears and encoders have several
    periods per turn. The parameters of the second period are ``period_2``, ``amplitude_2``, ``phase_2``, and so on. A second
    harmonic is then a period of its own, and there is no parameter ``harmonic``.

    Typical size 20 um. Dressler et al. 2010, section III.C: the manufacturer expects variations with a period of the length
    between the rack's teeth. For precision rack drives a deviation of 10 um is stated (Machine Design, see
    ``encoder_scale``).
    """

    id = "rack_periodic"
    title = "periodic drive error"
    clause = "{site} departs periodically along its track"
    remedy = "Look for what has this period: tooth pitch, pinion run-out, mounting; or compensate by the curve below."
    coefficient = ("cosine", "m")
    of_chains = ChainWords(
        clause="{site} departs periodically from its command",
        remedy="Look for what has these periods: an eccentric encoder, a gear, a strain wave; or compensate by the curve.",
    )
    of_travel = True
    of_own_command = True
    core = (0, 1)
    most_values = 24  # assumed: twice the lines that a joint of the UR10 of docs/real_arms.md has above 0.1 mrad

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def nonlinear_values(self, at: Situation, site: str) -> Sequence[float]:
        """Periods to try, so dense that the phase error over the whole track is at most a twelfth of a turn."""
        span = _span(at, site)
        if _turns(at, site):
            longest, shortest = TURN, TURN / MOST_A_TURN
            if span / LEAST_TURNS < shortest:
                return []
        else:
            longest, shortest = min(LONGEST, span / 3.0), SHORTEST
        frequencies = np.arange(1.0 / longest, 1.0 / shortest, 1.0 / (6.0 * span))
        return [float(1.0 / f) for f in frequencies]

    def resolved(self, at: Situation, site: str, values: Floats, others: Sequence[float]) -> npt.NDArray[np.bool_]:
        """At a turning joint of a robot without rods: ``LEAST_TURNS`` periods in its range, or ``APART`` from its others."""
        if not _turns(at, site):
            return super().resolved(at, site, values, others)
        cycles, span = 1.0 / np.asarray(values), _span(at, site)
        if not len(others):
            return np.asarray(cycles * span >= LEAST_TURNS * (1.0 - 1e-9))
        apart = np.abs(cycles[:, None] - 1.0 / np.asarray(others)).min(axis=1) * span
        return np.asarray(apart >= APART)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Cosine and sine of the period, their change along the track, and for robots with rods the second harmonic.

        For robots with rods the change is linear and quadratic in the travel x, so that the coefficients of the cosine and sine
        remain those of the middle.
        """
        assert nonlinear is not None
        j = at.robot.sites.index(site)
        phase, x = 2.0 * np.pi * at.q[:, j] / nonlinear, at.travel[:, j]
        c, s = np.cos(phase), np.sin(phase)
        columns, sizes = [c, s, x * c, x * s], [1.0, 1.0, *[MODULATION.line] * 2]
        if site not in joints(at.robot):
            columns += [x**2 * c, x**2 * s, c * c - s * s, 2.0 * c * s]  # the last two: of twice the phase
            sizes = [1.0, 1.0, *[MODULATION.period] * 6]
        return along_track(at, site, np.stack(columns).T, drive_sizes(at, site, sizes, 2e-5))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Period, amplitude, phase, and for robots with rods the second harmonic."""
        c, s = coefficients[:2]
        found = {
            "period": (float(nonlinear or 0.0), "m"),
            "amplitude": (float(np.hypot(c, s)), "m"),
            "phase": (float(np.arctan2(s, c)), "rad"),
        }
        harmonic = coefficients[6:8]
        return found | ({"harmonic": (float(np.hypot(*harmonic)), "m")} if harmonic.size else {})


def _turns(at: Situation, site: str) -> bool:
    """Whether a site is a turning joint of a robot without rods."""
    return turns(at.robot, site) and site in joints(at.robot)


def _span(at: Situation, site: str) -> float:
    """Range of a joint's commands, m or rad."""
    return max(float(np.ptp(at.q[:, at.robot.sites.index(site)])), 1e-9)
