"""Definition of each number of a certificate: its formula, and the clause of the standard, in our own words."""

from __future__ import annotations

from dataclasses import dataclass

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
    "AP_p_nominal_rms": Definition(
        "position accuracy, not corrected, RMS", "sqrt(mean(AP_p²))", f"{NOMINAL} {RMS}", f"{ISO_9283}, 7.2.1", True
    ),
    "AP_p_nominal_max": Definition(
        "position accuracy, not corrected, largest", "max(AP_p)", f"{NOMINAL} {MOST}", f"{ISO_9283}, 7.2.1", True
    ),
    "AP_p_corrected_rms": Definition(
        "position accuracy, corrected, RMS", "sqrt(mean(AP_p²))", f"{CORRECTED} {RMS}", f"{ISO_9283}, 7.2.1", True
    ),
    "AP_p_corrected_max": Definition(
        "position accuracy, corrected, largest", "max(AP_p)", f"{CORRECTED} {MOST}", f"{ISO_9283}, 7.2.1", True
    ),
    "AP_o_nominal_rms": Definition(
        "orientation accuracy, not corrected, RMS",
        "sqrt(mean(|θ|²))",
        "θ is the rotation vector between the mean and the commanded orientation; the standard has one angle for each "
        f"axis. {NOMINAL} {RMS}",
        f"{ISO_9283}, 7.2.1",
        True,
    ),
    "AP_o_nominal_max": Definition(
        "orientation accuracy, not corrected, largest", "max(|θ|)", f"{NOMINAL} {MOST}", f"{ISO_9283}, 7.2.1", True
    ),
    "AP_o_corrected_rms": Definition(
        "orientation accuracy, corrected, RMS", "sqrt(mean(|θ|²))", f"{CORRECTED} {RMS}", f"{ISO_9283}, 7.2.1", True
    ),
    "AP_o_corrected_max": Definition(
        "orientation accuracy, corrected, largest", "max(|θ|)", f"{CORRECTED} {MOST}", f"{ISO_9283}, 7.2.1", True
    ),
    "RP_l": Definition(
        "position repeatability",
        "RP_l = mean(l) + 3 s(l)",
        "l: distance of each visit from the mean of its pose; s: standard deviation with n - 1. The largest over the poses.",
        f"{ISO_9283}, 7.2.2",
    ),
    "RP_l_pooled": Definition(
        "position repeatability, as measured", "E|x| + 3 SD|x|", POOLED, f"{ISO_9283}, 7.2.2", True
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
