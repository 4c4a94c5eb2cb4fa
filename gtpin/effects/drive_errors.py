"""Errors of a drive along its own motion: scale, smooth and reversal errors, zeros that move, and lag."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.displacement import Displacement, along_track
from gtpin.effects.effect import ChainWords, Effect, ParameterRange, Parameters, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import number
from gtpin.effects.smooth import drive_load, drive_sizes, extent, modulated, session_columns, smooth_cosines
from gtpin.robot.chain import Chain
from gtpin.typing import Floats


class EncoderScale(Effect):
    """dq = s q: the travel is 1 + s times the command q; s > 0 where the actuator moves farther than commanded.

    dq is the deviation of the travel from the command, m (rad where the actuator turns). The modulation: s varies a little
    along the track.

    Parameters: ``scale`` s, m/m (rad/rad where the actuator turns); ``uneven``: s at the upper end of the range less s at the
    lower end, in the same unit.

    Typical size: s 1e-4. The norms of the track directions in Table II of Dressler et al. 2010, which include the
    drive's scale, differ from 1 by 0.5e-4 to 3.7e-4. The pitch error of a precision rack is at most 12 um per 500 mm,
    24e-6 (source as for ``rack_periodic``).
    """

    id = "encoder_scale"
    title = "wrong drive scale"
    clause = "travel per count of {site} is off by a constant factor"
    of_chains = ChainWords(
        clause="the motion of {site} per count is off by a constant factor",
        remedy="Set the drive's scale factor to the value below, and check the gear ratio.",
    )
    remedy = "Set the drive's scale factor to the value below, and check gear ratio or rack pitch."
    coefficient = ("scale", "m/m")
    of_travel = True
    exported_as = "drive_scale"
    alike = True  # tracks of one make and one temperature; or a machine whose unit of length is off
    core = (0,)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "scale": ParameterRange(-0.01, 0.01, "no drive's scale is off by a hundredth: its unit or gear ratio is wrong")
    }

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        j = at.robot.sites.index(site)
        columns, size = modulated(at.q[:, j], [at.travel[:, j]], MODULATION.scale)
        return along_track(at, site, columns, unit(size, 1e-4))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        return {"scale": (float(coefficients[0]), "m/m"), "uneven": (-2.0 * float(coefficients[1]), "m/m")}


SMOOTH_ORDERS, SMOOTH_DECAY = 20, 1.2
"""Number of cosines along the track, and the power p: the size of order k is proportional to k^-p. Cosines of higher order
would be confused with ``rack_periodic``."""


class Linearity(Effect):
    """dq = f(q), f a smooth function; f > 0 where the cart is farther along its track than commanded. ISO 230-1: EXX.

    dq is the deviation of the travel from the command q, m (rad where the actuator turns). f is a sum of cosines over the
    range of travel. Cosines of long wavelength have larger typical sizes.

    Parameters: ``rms`` and ``peak_to_valley`` of f over the whole range, after the best straight line is subtracted, m (rad
    where the actuator turns); ``end_to_end``, f at the upper end of the range less f at the lower end, in the same unit.

    Typical size: root mean square of f 50 um. Cart 2 of Dressler et al. 2010 departed from a straight line by 25 to 140
    um (section III.C).
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

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        j = at.robot.sites.index(site)
        columns, size = smooth_cosines(at, j, SMOOTH_ORDERS, SMOOTH_DECAY)
        return along_track(at, site, columns, drive_sizes(at, site, size, 5e-5))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        rms, span = extent(coefficients)
        ends = -2.0 * float(coefficients[::2].sum())
        return {"rms": (rms, "m"), "peak_to_valley": (span, "m"), "end_to_end": (ends, "m")}


class ZeroShift(Effect):
    """dq = z(session); dq is the deviation of the travel from the command, m (rad where the actuator turns).

    The shift z is constant in each session, and positive where the actuator is farther than commanded. Geometry absorbs the
    mean over the sessions. In a prediction, a session that was not in the fit has the mean shift.

    Parameters: ``shift[k]``, m: z of session k less the mean over the sessions, which are sorted by name;
    ``largest_difference``, m, between two sessions. As a change since an earlier model: ``shift`` alone, m, of all poses.
    Where the actuator turns, rad replaces m.

    Typical size: z 40 um, a guess for homing on a switch and a marker pulse. Without homing, the repeatability of the
    whole Gantry-Tau was 13 um in the mean and 50 um at most (Dressler et al. 2010, section I, after Crothers et al.
    2009).
    """

    id = "zero_shift"
    title = "zero shift"
    clause = "the zero of {site} moved between sessions"
    first_checked = True
    remedy = "Check homing and reference switch; home again before each session."
    coefficient = ("shift", "m")
    needs = ("session",)
    of_travel = True
    since_a_model = True

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        columns = session_columns(at)
        return along_track(at, site, columns, drive_sizes(at, site, np.ones(columns.shape[1]), 4e-5))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        if len(coefficients) == 1:
            return {"shift": (float(coefficients[0]), "m")}
        shifts = coefficients - coefficients.mean()
        found = {f"shift[{k + 1}]": (float(shift), "m") for k, shift in enumerate(shifts)}
        return {**found, "largest_difference": (float(np.ptp(shifts)), "m")}


PLAY_OR_FRICTION = (
    "Push to and fro with the drive held: play moves without a force, a drive that friction winds up moves against a spring. "
    "Against both: approach from one side, or set the drive's backlash compensation."
)


class Backlash(Effect):
    """dq = b approach; dq is the deviation of the actuator's travel from its command q, m (rad where it turns).

    The direction of approach is +1 where the actuator moved towards larger commands before it stopped, and -1 otherwise.
    b < 0: the actuator stops before its command (lost motion). b > 0: it overshoots. The modulation: b varies a little along
    the track and with the load on the actuator.

    Parameters: ``half_width`` b, m (rad where the actuator turns); ``reversal`` = 2 b, m or rad, the reversal error of
    ISO 230-2: the deviation at approach +1 less the deviation at approach -1.

    Typical size: b 15 um. The repeatability of the whole Gantry-Tau was 13 um in the mean and 50 um at most, over all
    directions of approach and with the backlash of all drives (Dressler et al. 2010, section I).
    """

    id = "backlash"
    title = "backlash (or friction wind-up)"
    clause = "{site} has backlash, or friction winds up its drive"
    first_checked = True
    of_chains = ChainWords(
        remedy=f"Check the play of the gear and its preload. {PLAY_OR_FRICTION}",
    )
    remedy = f"Check the preload of pinion and gear. {PLAY_OR_FRICTION}"
    coefficient = ("half_width", "m")
    of_travel = True
    between_visits = True
    core = (0,)
    expected_range: ClassVar[Mapping[str, ParameterRange]] = {
        "half_width": ParameterRange(-np.inf, 0.0, "a drive that overshoots is rare: the sign of approach may be wrong")
    }

    def covariates(self, robot: Chain, site: str) -> tuple[str, ...]:
        return (f"approach{number(robot, site)}",)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        j = at.robot.sites.index(site)
        load = drive_load(at, site)
        approach = at.covariate(f"approach{number(at.robot, site)}")
        columns, size = modulated(approach, [at.travel[:, j], load / 2.0], MODULATION.play)
        return along_track(at, site, columns, drive_sizes(at, site, size, 1.5e-5))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        half = float(coefficients[0])
        return {"half_width": (half, "m"), "reversal": (2.0 * half, "m")}


FAST = 0.3
"""Speed, m/s or rad/s, that scales the modulation of the lag by the speed."""


class ServoLag(Effect):
    """dq = -tau speed: at the instant of measurement the actuator is behind its command by tau times its speed.

    dq is the deviation of the travel from the command, m (rad where the actuator turns). The speed is the actuator's, m/s or
    rad/s. The modulation: tau varies a little along the track and with the speed.

    Parameters: ``lag`` tau, s, positive where the actuator is behind its command.

    Typical size: tau 0.2 ms. A position loop of gain Kv, some 10 to 100 / s, has a following error of speed / Kv
    (Mechanical Engineers' Handbook, vol. 2, Controller Design); that velocity feed-forward leaves a hundredth of it is
    a guess.
    """

    id = "servo_lag"
    title = "servo lag"
    clause = "{site} lags behind in proportion to its speed"
    remedy = "Measure at rest or slower; check position gain and velocity feed-forward."
    coefficient = ("lag", "s")
    of_travel = True
    alike = True  # position loops are tuned alike, so that the tool stays on its path
    between_visits = True
    core = (0,)
    expected_range: ClassVar[Mapping[str, ParameterRange]] = {
        "lag": ParameterRange(
            0.0, np.inf, "a drive ahead of its command has too much feed-forward, or the speed's sign is wrong"
        )
    }

    def covariates(self, robot: Chain, site: str) -> tuple[str, ...]:
        return (f"speed{number(robot, site)}",)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        j = at.robot.sites.index(site)
        speed = at.covariate(f"speed{number(at.robot, site)}")
        columns, size = modulated(-speed, [at.travel[:, j], speed / FAST], MODULATION.lag)
        return along_track(at, site, columns, unit(size, 2e-4))
