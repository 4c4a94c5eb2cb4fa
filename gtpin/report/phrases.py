"""Effects, causes, reasons and doubts in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from gtpin.diagnosis.result import Cause, Doubt, Findings, Member
from gtpin.effects.catalogue import catalogue
from gtpin.effects.effect import ChainWords, Effect
from gtpin.effects.sites import joints, tracks
from gtpin.effects.untestable import Untestable
from gtpin.estimate import WIDE, Estimate
from gtpin.report.words import SITES, capital, chance, joined, percent, quantity, site_words
from gtpin.robot.chain import Chain

SURE = 0.95
"""Smallest probability of a certain cause."""
SHOWN, LINES, NAMED = 6, 2, 3
"""Numbers of a cause's parameters that a terminal lists (the report lists all), and of periods and members of a class that a
headline names."""
TURN = 2.0 * np.pi
"""One turn, rad."""
TOLD = 0.03
"""Difference between the sum of shares and their common share from which they are said to overlap."""
REASONS = {
    "missing": "the covariate {covariate} is missing",
    "unusable": "the values of the covariate {covariate} can't be used: a warning says why",
    "constant": "the covariate {covariate} does not vary",
    "too_few_commands": "the commands of {site} are too few, or too close together",
    "one_sign": "the load does not change its sign",
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
    "scatter": "Visits scatter by more than the instrument, and the columns that would tell why contradict each other.",
    "chi_square": "Poses are farther from the earlier model than noise and its uncertainty allow, and no change explains them.",
}
"""Sentences by reason. For other reasons there is a warning, a question or the headline."""


def clause(effect: Effect, site: str, robot: Chain | None = None) -> str:
    """An effect at a site as a clause, such as ``cart1 has backlash``: from the effect's class, or from its title.

    ``robot``: the robot: effects of robots without rods have other words.
    """
    one, many, _ = _words(effect, robot)
    words = many if site == "arm" and many else one
    return (words or f"{effect.title} at {{site}}").replace("{site}", site_words(site))


def remedy(effect: Effect, robot: Chain) -> str:
    """What an engineer can do about an effect, as a sentence."""
    return _words(effect, robot).remedy


def _words(effect: Effect, robot: Chain | None) -> ChainWords:
    own = effect.of_chains if robot is not None and joints(robot) else ChainWords()
    return ChainWords(own.clause or effect.clause, own.plural or effect.plural_clause, own.remedy or effect.remedy)


def of_robot(paragraphs: list[str], robot: Chain) -> list[str]:
    """The paragraphs of an effect's description that are of a robot.

    What begins with robots without rods is for these alone; an equation there takes the place of the one for rods.
    """
    for k in [k for k, part in enumerate(paragraphs) if "robot without rods" in part[:50]]:
        if tracks(robot):
            return [*paragraphs[:k], *paragraphs[k + 1 :]]
        if " = " in paragraphs[k]:
            return paragraphs[k:]
    return paragraphs


def sentence(words: str) -> str:
    """Words as a sentence: a full stop, and a capital first letter unless the first word is the name of a site."""
    name = any(c.isdigit() or c in "_:" for c in words.split(" ")[0])
    return f"{words if name else capital(words)}."


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


def others(cause: Cause) -> list[Member]:
    """The other members of a cause's class."""
    return [m for m in cause.members if (m.effect, m.site) != (cause.effect, cause.site)]


def named(effect: Effect, site: str) -> str:
    """An effect at a site in prose: ``periodic drive error at cart2``."""
    return f"{effect.title} at {site_words(site)}"


def known_as(name: str, site: str) -> str:
    """As :func:`named`, by the id of an effect; one that is not of the catalogue keeps its id."""
    return next((named(e, site) for e in catalogue() if e.id == name), f"{name} at {site_words(site)}")


def parameter(name: str, value: float, unit: str, sigma: float | None = None) -> tuple[str, str]:
    """Name and value of a parameter as text: ``half width`` and ``24.9 ± 1.1 µm``; a period of what turns as periods a turn."""
    words = name.replace("_", " ")
    if _periodic(name, unit):
        turns = TURN / value
        return words.replace("period", "periods a turn"), quantity(turns, "", sigma and sigma * turns / value)
    return words, quantity(value, unit, sigma)


def interval(name: str, estimate: Estimate) -> tuple[str, str]:
    """Ends of a parameter's 95 % interval as text."""
    low, high = (parameter(name, end, estimate.unit)[1] for end in estimate.interval)
    return (high, low) if _periodic(name, estimate.unit) else (low, high)


def _periodic(name: str, unit: str) -> bool:
    return name.split("_")[0] == "period" and unit == "rad"


def value(name: str, estimate: Estimate) -> str:
    """A parameter with its value: ``half width 24.9 ± 1.1 µm``."""
    return " ".join(parameter(name, estimate.value, estimate.unit, estimate.sigma))


def size_words(parameters: Mapping[str, Estimate], count: int = 1) -> str:
    """The first ``count`` parameters in short, as known: ``half width 24.9 µm``; of periods ``24 a turn, 0.41 mrad``.

    In the place of a first one that may be zero stands the one that is known best.
    """
    lines, turns = [], False
    for name, period in parameters.items():
        if name.split("_")[0] == "period":
            size, turns = parameters[name.replace("period", "amplitude")], period.unit == "rad"
            often = f"{TURN / period.value:.3g}" if turns else quantity(period.value, period.unit)
            lines.append((size.value, often, quantity(size.value, size.unit, size.sigma, alone=True)))
    if lines:
        _, periods, sizes = (list(words) for words in zip(*sorted(lines, reverse=True)[:LINES], strict=True))
        often = f"{joined(periods)} a turn" if turns else f"every {joined(periods)}"
        more = f", and {len(lines) - LINES} more" if len(lines) > LINES else ""
        return f"{often}, {joined(sizes)}{more}"
    some = list(parameters.items())[:count]
    if count == 1 and some and abs(some[0][1].value) < WIDE * some[0][1].sigma:
        some = [max(parameters.items(), key=lambda one: abs(one[1].value) / max(one[1].sigma, 1e-300))]
    return ", ".join(f"{name.replace('_', ' ')} {quantity(e.value, e.unit, e.sigma, alone=True)}" for name, e in some)


def sized(found: Findings, one: Cause | Member, words: str) -> str:
    """Words for a cause or a member of a class, followed by its size where it is known."""
    return ", ".join(filter(None, (words, size_words(one.parameters, 1 + found.effect(one.effect).has_nonlinear))))


def cause_rows(found: Findings) -> list[list[str]]:
    """Rows of a table for a terminal: causes with probabilities, parameters and shares, each followed by its class."""
    rows = []
    for cause in found.causes:
        values = [value(*one) for one in cause.parameters.items()]
        more = [f"and {len(values) - SHOWN} more"] if len(values) > SHOWN else []
        share = percent(cause.explained_fraction) if found.gap.before > found.gap.floor else ""
        title = f"{found.effect(cause.effect).title}\n  at {site_words(cause.site)}"
        rows.append([title, chance(cause.probability), "\n".join(values[:SHOWN] + more), share])
        for m in others(cause):
            title = f"  or {found.effect(m.effect).title}\n     at {site_words(m.site)}"
            own = [value(*one) for one in m.parameters.items()]
            rows.append([title, chance(m.probability), "\n".join(own[:LINES]), ""])
    return rows


def cause_lines(found: Findings, noun: str = "gap") -> list[str]:
    """A line for each cause: first the certain ones, then the others, those that explain most of the gap first in both."""
    known = found.gap.before > found.gap.floor
    sure, doubtful = sure_and_doubtful(sorted(found.causes, key=lambda c: -c.explained_fraction))
    lines = []
    for cause in (*sure, *doubtful):
        share = f"; {percent(cause.explained_fraction)} of the {noun}" if known else ""
        if cause in sure or len(cause.members) == 1:
            how = "certain" if cause in sure else f"probable, {chance(cause.probability)}"
            said = f"{site_words(cause.site)}: {sized(found, cause, found.effect(cause.effect).title)} ({how}{share})"
            lines.append(said if cause.site not in SITES else capital(said))
        else:
            lines.append(_open(found, cause, share, "also " if lines else ""))
    return [f"{line}." for line in lines]


def _open(found: Findings, cause: Cause, share: str, also: str) -> str:
    """The class of a cause that is open, with sizes and probabilities; what all names or sites have in common is said once."""
    told: list[tuple[list[Member], float]] = []
    for m in cause.members:
        pair = [o for o in cause.members if m.beside == (o.effect, o.site) and o.beside == (m.effect, m.site)][:1]
        if not any(m in both for both, _ in told):
            told.append(([m, *pair], sum(one.probability for one in (m, *pair))))
    titles = [found.effect(m.effect).title.split(" ") for both, _ in told for m in both]
    same = 0
    while len(told) > 1 and same < min(map(len, titles)) - 1 and len({title[-1 - same] for title in titles}) == 1:
        same += 1
    if titles[0][-1].endswith(")"):  # what stands in brackets explains each title
        same = 0
    sites = {m.site for both, _ in told for m in both}
    common = " ".join(titles[0][len(titles[0]) - same :]) or "one of these"
    place = f" at {site_words(cause.site)}" if len(sites) == 1 else ""

    def words(m: Member) -> str:
        title = " ".join(found.effect(m.effect).title.split(" ")[: -same or None])
        return sized(found, m, title + ("" if place else f" at {site_words(m.site)}"))

    parts = [f"{' with '.join(map(words, both))} ({chance(p)})" for both, p in told]
    if len(parts) > NAMED:
        parts = [*parts[:NAMED], "another" if len(parts) == NAMED + 1 else f"one of {len(parts) - NAMED} others"]
    parts[-1] = f"or {parts[-1]}"
    return capital(f"{also}{common}{place} (open{share}): {(', ' if len(parts) < 3 else '; ').join(parts)}")


def badge(found: Findings) -> str:
    """The numbers of certain, open and unknown causes in short: ``1 certain, 1 open``; empty where there is none."""
    sure, doubtful = map(len, sure_and_doubtful(found.causes))
    counts = ((sure, "certain"), (doubtful, "open"), (int(found.verdict == "unknown"), "unknown"))
    return ", ".join(f"{count} {word}" for count, word in counts if count)


def overlap(found: Findings) -> str:
    """A sentence where the causes' shares do not sum to what they explain together; else empty."""
    whole, shares = found.gap.explained_fraction, [c.explained_fraction for c in found.causes]
    if whole is None or len(shares) < 2 or abs(sum(shares) - whole) < TOLD:
        return ""
    told = "The shares overlap: each is what goes away with one cause, given the others"
    return f"{told}; together it is {percent(whole)}."
