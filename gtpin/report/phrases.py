"""Effects, causes, reasons and doubts in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from gtpin.diagnosis.inference.findings import Cause, Doubt, Member
from gtpin.effects.effect import ChainWords, Effect
from gtpin.effects.untestable import Untestable
from gtpin.estimate import Estimate
from gtpin.report.words import chance, joined, quantity, site_words
from gtpin.robot.robot import Robot

SURE = 0.95
"""Smallest probability of a certain cause."""
SHOWN = 6
"""Number of parameters of a cause that a terminal lists; the report lists all."""
REASONS = {
    "missing": "the covariate {covariate} is missing",
    "unusable": "the values of the covariate {covariate} can't be used: a warning says why",
    "constant": "the covariate {covariate} does not vary",
    "too_few_commands": "the commands of {site} are too few, or too close together",
    "one_sign": "the link's force does not change its sign",
    "no_load": "the joint carries nothing about its own axis",
    "no_masses": "the URDF has no masses, and no payload or force on the tool was recorded",
    "single_joint": "the cart carries a single joint, and a rotation about it does not move the platform",
    "absorbed": "geometric calibration absorbs it",
    "unrecorded_payload": "the payload may have varied without being recorded",
    "not_searched": "a check does not search for periods and steps: diagnose the poses of a calibration",
    "uncertain": "the uncertainty of the earlier model and of the instrument's pose hides it",
    "other": "{words}",
}
"""Why an effect can't be tested, by kind."""
DOUBTS = {
    "description": (
        "What moves {site} follows {columns} as any smooth motion could: this describes the error, and is no cause. Left-out "
        "regions and another site or column tell whether a mechanism is behind it."
    ),
    "restless": "{site} errs from pose to pose by more than repeated visits let it scatter.",
    "held_out": (
        "Poses that were left out of the fit are farther off than the noise that was declared or that repeated visits show, "
        "or no nearer with causes than without."
    ),
    "excess": (
        "The residuals are larger than the declared noise, no effect explains the difference, and too few poses were visited "
        "twice to tell whether it repeats."
    ),
    "visits": (
        "Visits to the same commands differ otherwise than the declared noise and the drives' repeatability allow: something "
        "changes between them."
    ),
    "two_valued": (
        "The errors of {site} take two values, as play does whose direction of approach is not known: check {columns}, which "
        "may belong to other rows."
    ),
    "scatter": "Visits scatter by more than the instrument, and the columns that would tell why contradict each other.",
    "chi_square": "Poses are farther from the earlier model than noise and its uncertainty allow, and no change explains them.",
}
"""Sentences by reason. For other reasons there is a warning, a question or the headline."""


def clause(effect: Effect, site: str, robot: Robot | None = None) -> str:
    """An effect at a site as a clause, such as ``cart1 has backlash``: from the effect's class, or from its title.

    ``robot``: the robot: effects of robots without rods have other words.
    """
    own = effect.of_chains if robot is not None and not robot.rods else ChainWords()
    one, many = own.clause or effect.clause, own.plural or effect.plural_clause
    words = many if site == "arm" and many else one
    return (words or f"{effect.title} at {{site}}").replace("{site}", site_words(site))


def remedy(effect: Effect, robot: Robot) -> str:
    """What an engineer can do about an effect, as a sentence."""
    own = "" if robot.rods else effect.of_chains.remedy
    return own or effect.remedy


def sentence(words: str) -> str:
    """Words as a sentence: a full stop, and a capital first letter unless the first word is the name of a site."""
    name = any(c.isdigit() or c == "_" for c in words.split(" ")[0])
    return f"{words if name else words[:1].upper() + words[1:]}."


def reason_words(reason: Untestable | None, site: str) -> str:
    """Why an effect at a site can't be tested, as part of a sentence; empty if it can be tested."""
    return REASONS[reason.kind].format(covariate=reason.covariate, site=site, words=reason.words) if reason else ""


def doubt_words(doubts: Iterable[Doubt]) -> list[str]:
    """A sentence for each doubt that needs one."""
    return [
        DOUBTS[doubt.reason].format(site=site_words(doubt.site), columns=joined(list(doubt.over)))
        for doubt in doubts
        if doubt.reason in DOUBTS
    ]


def sure_and_doubtful(causes: Iterable[Cause]) -> tuple[list[Cause], list[Cause]]:
    """The certain causes, and the others."""
    found = list(causes)
    return [c for c in found if c.probability >= SURE], [c for c in found if c.probability < SURE]


def either(named: Sequence[str], what: str) -> str:
    """The members of the class of an ambiguous cause as a clause; ``what`` does not decide between them."""
    if len(named) == 1:
        return f"probably {named[0]}, but {what} don't decide it"
    more = f", or one of {len(named) - 3} others" if len(named) > 4 else ", or another" if len(named) == 4 else ""
    return f"{joined(list(named[:3]), 'or')}{more}: {what} can't tell"


def others(cause: Cause) -> list[Member]:
    """The other members of a cause's class."""
    return [m for m in cause.members if (m.effect, m.site) != (cause.effect, cause.site)]


def value(name: str, estimate: Estimate) -> str:
    """A parameter with its value: ``half width 24.9 ± 1.1 µm``."""
    return f"{name.replace('_', ' ')} {quantity(estimate.value, estimate.unit, estimate.sigma)}"


def cause_rows(causes: Iterable[Cause]) -> list[list[str]]:
    """Rows of a table for a terminal: each cause with its probability and parameters, then the others of its class."""
    rows = []
    for cause in causes:
        values = [value(name, estimate) for name, estimate in cause.parameters.items()]
        more = [f"and {len(values) - SHOWN} more"] if len(values) > SHOWN else []
        rows.append([f"{cause.effect} at {cause.site}", chance(cause.probability), "\n".join(values[:SHOWN] + more)])
        rows += [[f"  or {m.effect} at {m.site}", chance(m.probability), ""] for m in others(cause)]
    return rows
