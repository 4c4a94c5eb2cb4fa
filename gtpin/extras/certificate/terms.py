"""Terms of a certificate: what each number is, by formula and clause of the standard in our own words, and why it is blank."""

from __future__ import annotations

from dataclasses import dataclass

from gtpin.extras.certificate.pose_accuracy import CYCLES
from gtpin.extras.certificate.positioning import APPROACHES, TARGETS
from gtpin.extras.certificate.quantity import Missing
from gtpin.noise.estimate import LEAST_CONTRASTS

ISO_9283 = "ISO 9283:1998"
ISO_230_2 = "ISO 230-2:2014"


@dataclass(frozen=True)
class Definition:
    """Name, formula and explanation of a number, and the clause of the standard; ``estimate``: the number is only similar to
    that of the clause."""

    name: str
    formula: str
    words: str
    standard: str
    estimate: bool = False


AP = "distance of the mean measured pose of a command from the commanded pose"
NOMINAL = "The commanded pose is that of the nominal geometry: the machine before correction."
CORRECTED = "The commanded pose is what the model predicts: the machine after correction."
ANGLE = (
    "θ is the rotation vector between the mean and the commanded orientation; the standard has one angle for each axis."
)
RMS = "Root mean square over all poses, less the part of the scatter, tr(S) / n for n visits of covariance S."
MOST = "The largest over all poses. Of a pose with few visits it contains their noise."
POOLED = (
    "The value that many visits would have: mean length and standard deviation of a normal scatter whose covariance is pooled "
    "over all poses with two visits or more."
)
DEFINITIONS = {
    "AP_p": Definition(
        "position accuracy",
        "AP_p = |mean(x) - x_c|",
        f"The {AP}, position. The largest over the poses.",
        f"{ISO_9283}, 7.2.1",
    ),
    **{
        f"AP_{part}_{which}_{size}": Definition(
            f"{what} accuracy, {'' if which == 'corrected' else 'not '}corrected, {'RMS' if size == 'rms' else 'largest'}",
            f"sqrt(mean({symbol}²))" if size == "rms" else f"max({symbol})",
            " ".join(
                [
                    *((ANGLE,) if (part, which, size) == ("o", "nominal", "rms") else ()),
                    NOMINAL if which == "nominal" else CORRECTED,
                    RMS if size == "rms" else MOST,
                ]
            ),
            f"{ISO_9283}, 7.2.1",
            True,
        )
        for part, what, symbol in (("p", "position", "AP_p"), ("o", "orientation", "|θ|"))
        for which in ("nominal", "corrected")
        for size in ("rms", "max")
    },
    "RP_l": Definition(
        "position repeatability",
        "RP_l = mean(l) + 3 s(l)",
        "l: distance of each visit from the mean of its pose; s: standard deviation with n - 1. The largest over the poses.",
        f"{ISO_9283}, 7.2.2",
    ),
    "RP_l_pooled": Definition(
        "position repeatability, with the instrument's noise", "E|x| + 3 SD|x|", POOLED, f"{ISO_9283}, 7.2.2", True
    ),
    "RP_l_machine": Definition(
        "position repeatability of the machine",
        "E|x| + 3 SD|x|",
        "The same without the instrument's own noise: its variance is subtracted.",
        f"{ISO_9283}, 7.2.2",
        True,
    ),
    **{
        f"RP_{axis}_pooled": Definition(
            f"orientation repeatability about {name}",
            "3 s",
            "Three standard deviations of the angle about the axis, pooled over all poses with two visits or more.",
            f"{ISO_9283}, 7.2.2",
            True,
        )
        for axis, name in zip("abc", "xyz", strict=True)
    },
    "B": Definition(
        "reversal",
        "B = max|x̄↑ - x̄↓|",
        "x̄↑, x̄↓: mean deviation at a target, approached upwards and downwards. The largest over the targets.",
        f"{ISO_230_2}, clause 3",
    ),
    "E": Definition(
        "systematic positioning deviation",
        "E = max(x̄) - min(x̄)",
        "Range of the mean deviations over all targets and both directions.",
        f"{ISO_230_2}, clause 3",
    ),
    "R": Definition(
        "positioning repeatability",
        "R = max(2 s↑ + 2 s↓ + |B|, 4 s↑, 4 s↓)",
        "s: standard deviation at a target, from each side. The largest over the targets.",
        f"{ISO_230_2}, clause 3",
    ),
    "A": Definition(
        "positioning accuracy",
        "A = max(x̄ + 2 s) - min(x̄ - 2 s)",
        "Over all targets and both directions, of the machine before correction.",
        f"{ISO_230_2}, clause 3",
    ),
    "B_mean": Definition(
        "mean reversal",
        "2 × coefficient of the direction (+1, -1)",
        "Least squares of the actuator's deviations, as the TCP shows them and a model without backlash leaves them, on the "
        "directions of approach of all actuators, over all poses.",
        f"{ISO_230_2}, clause 3",
        True,
    ),
}
SOURCES = (
    "ISO 9283:1998, Manipulating industrial robots: performance criteria and related test methods.",
    "ISO 230-2:2014, Test code for machine tools, part 2: accuracy and repeatability of positioning of numerically controlled "
    "axes.",
    "JCGM 100:2008 (GUM), Guide to the expression of uncertainty in measurement; JCGM 102:2011 for several axes together.",
    "M. Slamani, A. Nubiola, I. Bonev: Assessment of the positioning performance of an industrial robot. Industrial Robot 39 "
    "(2012) 57-68.",
)
WHY: dict[Missing, str] = {
    "few_cycles": f"no pose was visited {CYCLES} times, as ISO 9283 asks; the most are {{have}}",
    "few_visits": f"fewer than {LEAST_CONTRASTS} repeated visits ({{have}}), so that the scatter can't be estimated",
    "few_targets": f"{TARGETS} targets on a line of this actuator are needed, the other actuators at rest, each approached "
    f"{APPROACHES} times from both sides; the longest line has {{have}}",
    "within_noise": "the scatter of the visits is no larger than the instrument's own noise",
    "no_orientation": "orientation was not measured",
    "no_approach": "the direction of approach was not recorded, or hardly varies: columns approach1, approach2, ...",
    "free_target": "the place of the target on the platform was not known before the calibration",
    "too_many_drives": "the measured pose does not determine the travel of each actuator",
    "known_in_mean": "errors at left-out poses are known as a mean only; measure new poses and certify them with --model",
    "fitted_poses": "the model was fitted to these poses; certify new poses, or leave --model out",
    "not_declared": "the instrument's noise was not declared (position_sigma in dataset.toml), so that the scatter of visits "
    "can't be divided between instrument and machine",
    "not_stated": "the instrument's systematic error was not stated: give the standard uncertainty of its certificate with "
    "--instrument-uncertainty",
}
"""Why a number is blank."""
STATE: tuple[Missing, ...] = ("not_stated", "not_declared", "no_approach")
"""Reasons of what is blank until the user states what is known without a measurement."""
STATED = {
    "unknown": "The diagnosis found errors that no known effect explains. They count as unexplained, and can be larger at "
    "other poses. The scatter of visits can be a part of them: only declared noise is not counted as an error.",
    "ambiguous": "The diagnosis does not decide between several effects. Under conditions that were not recorded, their "
    "errors differ.",
    "no": "The instrument's noise was not declared, and repeated visits do not show it. All residuals count as errors of the "
    "machine.",
}
"""What a certificate states of the diagnosis, by its verdict, and of the noise, by how it is known."""
ROWS = {
    "model": "geometry and effects of the model",
    "frame": "pose of the instrument's frame",
    "repeatability": "repeatability of the actuators",
    "unexplained": "unexplained by the model",
    "instrument": "systematic error of the instrument",
}
HOW = {
    "model": "joint covariance of the fit: the noise of the readings, and the tolerances where the poses determine nothing",
    "frame": "least squares over the measured poses, given the other unknowns",
    "repeatability": "maximum likelihood from repeated visits, limited by the size of all errors beyond noise; scatter beyond "
    "noise that is not like that of actuators counts as unexplained",
    "unexplained": "errors of the corrected machine beyond noise and the other contributions, enlarged for their own "
    "uncertainty",
    "instrument": "as stated",
}
BASES = {
    "left_out": "The model was identified from these poses. Errors of the corrected machine are those at poses that were left "
    "out of the fit in turn.",
    "new": "The model was identified from other poses than these.",
    "fitted": "The model was fitted to these poses. Residuals are smaller than errors at other poses, so that the budget has "
    "the errors at poses that are left out of the fit.",
}
