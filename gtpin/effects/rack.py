"""Errors of a rack, a gear or an encoder: periodic deviations, and a step where two segments meet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gtpin.effects.displacement import Displacement, along_track
from gtpin.effects.effect import ChainWords, Effect, Nature, Parameters, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import TURN, OperatingPoints, References
from gtpin.effects.sites import joints, tracks, turning_joint
from gtpin.effects.smooth import drive_sizes
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

SHORTEST, LONGEST = 0.0045, 0.25
"""Shortest and longest period that is tried, m or rad: below the tooth of a rack of module 1.5 mm (pi times that, 4.7 mm), and
one turn of a large pinion."""
MOST_A_TURN = 202.0
"""Largest number of periods per turn that is tried at a turning joint of a robot without rods. A strain wave gear of ratio 101
has two periods for each turn of its input."""
LEAST_TURNS = 1.5
"""Smallest number of periods in the joint's range of commands. With fewer the deviation is a ``linearity``, unless the joint
has another period as well, or this one is a whole turn: that of an eccentric wheel or encoder."""
APART = 0.5
"""Smallest difference of two periods of one joint, and of one from none, in cycles over its range of commands. Derived: the
Fourier resolution is one cycle; at half of it, the cosines of two periods have a correlation of sin(pi / 2) / (pi / 2) = 0.64.
Nearer ones are one line whose amplitude changes, or no line."""

MOST_GEARS = 2
"""Largest number of gears that the periods of a joint may need, beside its own turn. Assumed: an input and a middle shaft."""

FEW_PERIODS = 2.0
"""Number of periods in a joint's range below which ``APART`` fewer can be as likely. A scan compares periods with all else
fixed. Computed: of a cosine of n periods, one of n - 1/2 with a constant, a slope and a bend leaves 0.3 % of the power for
n = 1, 5 % for 1.5, 25 % for 2, and half of it from 2.5 on."""


class RackPeriodic(Effect):
    """dq = A cos(2 pi q / p - phi); dq is the deviation of the travel from the command q, m (rad where the actuator turns).

    The modulation: amplitude and phase change along the track (linearly and quadratically for robots with rods), and the
    deviation has a second harmonic, with the period p / 2.

    Parameters: ``period`` p, m, the nonlinear parameter; ``amplitude`` A > 0 at the middle of the range, m; ``phase`` phi,
    rad: the deviation has a maximum at q = p phi / (2 pi); ``harmonic``, amplitude of the second harmonic, m. Where the
    actuator turns, rad replaces m.

    At a turning joint of a robot without rods, one cause can have several periods, because gears and encoders have several
    periods per turn. The parameters of the second period are ``period_2``, ``amplitude_2``, ``phase_2``, and so on. A second
    harmonic is then a period of its own, and there is no parameter ``harmonic``. More than two periods without a common gear
    describe a rough drive: the cause's nature is then ``profile``.

    Typical size: A cos phi and A sin phi 20 um each. A trade journal gives 10 um for precision drives (Machine Design,
    "Comparing rack and pinion sets", machinedesign.com). The manufacturer of the Gantry-Tau's racks expects variations
    with the length between their teeth as the period (Dressler et al. 2010, section III.C). Periods from 4.5 mm (the
    tooth of a rack of module 1.5 mm has pi 1.5 mm) to 0.25 m, and at most a third of the range of the commands, are
    tried; at a turning joint of a robot without rods from 202 periods a turn to one.
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

    def nonlinear_values(self, at: OperatingPoints, site: str) -> Sequence[float]:
        """Periods to try, so dense that the phase error over the whole track is at most a twelfth of a turn."""
        span = _span(at, site)
        if turning_joint(at.robot, site):
            longest, shortest = TURN, TURN / MOST_A_TURN  # an eccentric encoder has one period per turn
            if span / LEAST_TURNS < shortest:
                return []
        else:
            longest, shortest = min(LONGEST, span / 3.0), SHORTEST
        step = 1.0 / (6.0 * span)
        # One step beyond the shortest: a scan refines its best value between the neighbours.
        frequencies = np.arange(1.0 / longest, 1.0 / shortest + 2.0 * step, step)
        return [float(1.0 / f) for f in frequencies]

    def resolved(
        self, at: OperatingPoints, site: str, values: Floats, others: Sequence[float]
    ) -> npt.NDArray[np.bool_]:
        """At a turning joint of a robot without rods: ``LEAST_TURNS`` periods in its range, or a turn of which it has
        ``APART``; beside other periods: ``APART`` from these."""
        if not turning_joint(at.robot, site):
            return super().resolved(at, site, values, others)
        cycles, span = 1.0 / np.asarray(values), _span(at, site)
        if not len(others):
            least = np.where(np.isclose(values, TURN, rtol=1e-9, atol=0.0), APART, LEAST_TURNS)
            return np.asarray(cycles * span >= least * (1.0 - 1e-9))
        known = np.append(1.0 / np.asarray(others), 0.0)  # the slope of a period longer than twice the range is a scale
        apart = np.abs(cycles[:, None] - known).min(axis=1) * span
        return np.asarray(apart >= APART)

    def ends(self, robot: Chain, site: str, references: References, value: float, sigma: float) -> tuple[float, float]:
        """Of a period that the fit has seen less than twice: at least half a period more or less in the same range, up to one
        period a turn."""
        if turning_joint(robot, site):
            lower, upper = (float(ends[robot.sites.index(site)]) for ends in references.commands)
            if upper - lower < FEW_PERIODS * value:
                more = max(sigma / value**2, APART / (upper - lower))
                return 1.0 / (1.0 / value + more), max(1.0 / max(1.0 / value - more, 1.0 / TURN), value)
        return super().ends(robot, site, references, value, sigma)

    def nature_of(self, lines: Sequence[tuple[float, float]]) -> Nature:
        """A profile where more than ``MOST_GEARS`` periods have no common gear: they describe a rough drive."""
        return "profile" if _gears(lines) > MOST_GEARS else self.nature

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        assert shape_parameter is not None
        return self.bases(at, site, [shape_parameter])[0]

    def bases(self, at: OperatingPoints, site: str, values: Sequence[float] | Floats) -> list[Displacement]:
        j = at.robot.sites.index(site)
        # The change is linear and quadratic in the travel x, so that the first two coefficients are those of the middle.
        phase, x = 2.0 * np.pi * at.q[:, j] / np.asarray(values)[:, None], at.travel[:, j]
        c, s = np.cos(phase), np.sin(phase)
        columns, sizes = [c, s, x * c, x * s], [1.0, 1.0, *[MODULATION.line] * 2]
        if site not in joints(at.robot):
            columns += [x**2 * c, x**2 * s, c * c - s * s, 2.0 * c * s]  # the last two: of twice the phase
            sizes = [1.0, 1.0, *[MODULATION.period] * 6]
        found = np.stack(columns, axis=1).swapaxes(1, 2)  # each value's numbers of one column are next to each other
        sigma = drive_sizes(at, site, sizes, 2e-5)
        return [along_track(at, site, one, sigma) for one in found]

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        c, s = coefficients[:2]
        found = {
            "period": (float(shape_parameter or 0.0), "m"),
            "amplitude": (float(np.hypot(c, s)), "m"),
            "phase": (float(np.arctan2(s, c)), "rad"),
        }
        harmonic = coefficients[6:8]
        return found | ({"harmonic": (float(np.hypot(*harmonic)), "m")} if harmonic.size else {})


def _gears(lines: Sequence[tuple[float, float]]) -> int:
    """Number of gears, beside the joint's own turn, that some periods (value, sigma), rad, need.

    A period belongs to a turn, or to a gear, where a whole number of it is one turn, or the longest period of the gear, to
    within two standard deviations.
    """
    gears, left = 0, sorted(((TURN / value, sigma * TURN / value**2) for value, sigma in lines))
    first = 1.0
    while left:
        left = [(f, s) for f, s in left if abs(f / first - round(f / first)) * first > 2.0 * s or f < 0.5 * first]
        if left:
            first, gears = left[0][0], gears + 1
    return gears


def _span(at: OperatingPoints, site: str) -> float:
    """Range of a joint's commands, m or rad."""
    return max(float(np.ptp(at.q[:, at.robot.sites.index(site)])), 1e-9)


FEWEST_BEYOND = 3
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

    Typical size: h 50 um. Matched rack segments have position errors of at most 40 um (source as for
    ``rack_periodic``).
    """

    id = "rack_step"
    title = "step in the drive"
    clause = "{site} steps where two rack segments meet"
    of_chains = ChainWords(
        clause="the travel of {site} has a step", remedy="Check the scale or rack at the place below, and its joint."
    )
    remedy = "Check the joint of the rack's segments at the place below, and its gap gauge."
    coefficient = ("step", "m")
    acts_at = staticmethod(tracks)
    of_travel = True
    of_own_command = True
    core = (0,)

    def nonlinear_values(self, at: OperatingPoints, site: str) -> Sequence[float]:
        """Places to try: the middle between neighbouring commands, except near the ends of the track."""
        q = np.unique(at.q[:, at.robot.sites.index(site)])
        between = (q[1:] + q[:-1]) / 2.0
        edge = max(FEWEST_BEYOND - 1, len(between) // 100)
        inner = between[edge:-edge]
        return [float(place) for place in inner[:: max(1, len(inner) // 100)]]

    def jumps(self, shape_parameter: float | None) -> tuple[float, ...]:
        return () if shape_parameter is None else (shape_parameter,)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        assert shape_parameter is not None
        j = at.robot.sites.index(site)
        past = at.q[:, j] - shape_parameter
        beyond = (past > 0.0).astype(float)
        flanks = [np.clip(0.5 + past / width, 0.0, 1.0) - beyond for width in FLANKS]
        span = at.robot.upper[j] - at.robot.lower[j]
        sizes = [1.0, MODULATION.slope / span, *[MODULATION.flank] * len(FLANKS)]
        return along_track(at, site, np.stack([beyond, beyond * past, *flanks], axis=1), unit(sizes, 5e-5))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        step, slope = (float(c) for c in coefficients[:2])
        return {"place": (float(shape_parameter or 0.0), "m"), "step": (step, "m"), "slope": (slope, "m/m")}
