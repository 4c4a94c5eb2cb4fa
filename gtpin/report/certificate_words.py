"""A certificate in sentences: the certified uncertainty, its limits, and why numbers are blank."""

from __future__ import annotations

import numpy as np

from gtpin.certificate.budget import COVERAGE, Contribution
from gtpin.certificate.pose_accuracy import CYCLES
from gtpin.certificate.positioning import APPROACHES, TARGETS
from gtpin.certificate.quantity import Missing, Quantity
from gtpin.certificate.result import Certificate
from gtpin.noise.repeats import LEAST_CONTRASTS
from gtpin.report.words import counted, joined, percent, quantity, whole

WHY: dict[Missing, str] = {
    "few_cycles": f"no pose was visited {CYCLES} times, as ISO 9283 asks; the most are {{have}}",
    "few_visits": f"fewer than {LEAST_CONTRASTS} repeated visits ({{have}}) say too little of the scatter",
    "few_targets": f"no {TARGETS} targets on a line of this actuator, the others at rest, each approached {APPROACHES} times "
    "from both sides; the longest line has {have}",
    "within_noise": "the scatter of the visits is no larger than the instrument's own noise",
    "no_orientation": "orientation was not measured",
    "no_approach": "the direction of approach was not recorded, or hardly varies",
    "free_target": "where the target sits on the platform is not known beforehand",
    "too_many_drives": "the measured pose does not determine the travel of each actuator",
    "known_in_mean": "errors at left-out poses are known as a mean only; measure new poses and certify them with --model",
    "fitted_poses": "the model was fitted to these poses; certify new poses, or leave --model out",
    "not_declared": "the instrument's noise was not declared, so that the scatter of visits can't be divided between "
    "instrument and machine",
    "not_stated": "not stated: give the standard uncertainty of the instrument's certificate with --instrument-uncertainty",
    "no_effects": "the model has no effects",
    "frame_is_base": "the instrument measures in the base frame",
}
ROWS = {
    "geometry": "geometry, its posterior",
    "effects": "effects, their posterior",
    "correlation": "correlation of geometry and effects",
    "frame": "pose of the instrument's frame",
    "repeatability": "repeatability of the actuators",
    "unexplained": "unexplained by the model",
    "instrument": "systematic error of the instrument",
}
HOW = {
    "geometry": "covariance of the fit: the noise of the readings, and the tolerances where the poses say nothing",
    "effects": "covariance of the joint fit",
    "correlation": "2 J_g Σ_ge J_e' (JCGM 100, 5.2); a negative value lessens the sum",
    "frame": "least squares over the measured poses, given the other unknowns",
    "repeatability": "maximum likelihood from repeated visits, at most the excess of all errors",
    "unexplained": "excess of the errors of the corrected machine over noise and the other contributions, with its own doubt",
    "instrument": "stated by the user",
}
BASES = {
    "left_out": "The model was identified from these poses. Errors of the corrected machine are those at poses that were left "
    "out of the fit in turn.",
    "new": "The model was identified before. These poses are new to it.",
    "fitted": "The model was fitted to these very poses. Residuals are smaller than errors; the budget allows for that.",
}


def why(q: Quantity | Contribution) -> str:
    """Why a number is blank."""
    if q.missing is None:
        return ""
    return WHY[q.missing].format(have=q.have if isinstance(q, Quantity) else "none or few")


def headline(c: Certificate) -> str:
    """The corrected machine's uncertainty, in one sentence."""
    return f"The corrected machine positions its TCP within {quantity(c.budget.radius, 'm')} in 95 % of cases."


def statement(c: Certificate) -> list[str]:
    """The certified uncertainty, its basis, and the limits within which it holds."""
    U = COVERAGE * c.budget.combined[:3]
    axes = joined([f"{axis} {quantity(float(u), 'm')}" for axis, u in zip("xyz", U, strict=True)])
    found = [
        f"Expanded uncertainty with k = {COVERAGE:g} (95 %), root mean square over the workspace: {axes}.",
        f"It rests on {counted(c.rows, 'measurement')} of {counted(c.poses, 'pose')}. {BASES[c.basis]}",
        "It holds between the measured commands, under the recorded conditions, and for a controller that uses the model.",
    ]
    if c.verdict == "unknown":
        found.append(
            "The diagnosis found structure that no known effect explains. It counts as unexplained, and may be larger "
            "elsewhere."
        )
    if c.verdict == "ambiguous":
        found.append(
            "The diagnosis leaves open which of several effects acts. They differ under conditions that were not recorded."
        )
    if c.noise_known == "no":
        found.append(
            "The instrument's noise was not declared, and no repeated visits show it. All residuals count as errors of the "
            "machine."
        )
    if c.set_aside:
        found.append(f"Set aside: {joined(list(c.set_aside))}.")
    return found


def visits_words(c: Certificate) -> str:
    """The visits from which repeatabilities are computed."""
    if c.one_way:
        return "Repeatabilities are of visits with the same directions of approach."
    return "Repeatabilities are of visits from any side: reversal is part of them. The standard asks for visits from one side."


def limits(c: Certificate) -> str:
    """The ranges of commands in which the certificate holds."""
    low, high = c.dataset.q.min(axis=0), c.dataset.q.max(axis=0)
    units = ["rad" if turns else "m" for turns in np.asarray(c.model.robot.revolute)]
    return joined([f"{site} {low[i]:.3f} to {high[i]:.3f} {units[i]}" for i, site in enumerate(c.model.robot.sites)])


def share_words(share: float) -> str:
    """A share of the variance; that of a correlation may be negative."""
    return percent(share) if share >= 0.0 else whole(f"{min(-1.0, 100.0 * share):.0f} %")
