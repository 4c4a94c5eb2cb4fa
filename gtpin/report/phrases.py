"""Effects, causes, reasons and doubts in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from gtpin.diagnosis.priors import CLASS_SHARE, SURE
from gtpin.diagnosis.result import Cause, Doubt, Findings, Member
from gtpin.effects.catalogue import catalogue
from gtpin.effects.effect import ChainWords, Effect
from gtpin.effects.sites import joints, tracks
from gtpin.effects.untestable import Untestable
from gtpin.estimate import WIDE, Estimate
from gtpin.report.words import SITES, capital, chance, joined, length, percent, quantity, site_words
from gtpin.robot.chain import Chain

PROBABLE = 0.75
"""Probability of a cause from which the other members of its class are called not excluded, not as equals. Assumed."""
SHOWN, LINES = 4, 2
"""Numbers of a cause's parameters in the table of causes, and of periods, parameters of another member of a class, and lines
of causes in a headline."""
TURN = 2.0 * np.pi
"""One turn, rad."""
OVERLAP = 0.03
"""Difference between the sum of shares and their common share from which they overlap."""
ORDINALS = {"1": "1st", "2": "2nd", "3": "3rd"}
TWO_AXES = {"difference": "more about a than b", "skew": "about a by a load about b"}
"""Parameters of what gives way about two axes a and b, in words."""
REASONS = {
    "missing": "the covariate {covariate} is missing",
    "unusable": "the values of the covariate {covariate} can't be used: a warning says why",
    "constant": "the covariate {covariate} does not vary",
    "too_few_commands": "the commands of {site} are too few, or too close together",
    "one_sign": "the load does not change its sign",
    "no_load": "there is no load about the joint's own axis",
    "no_masses": "the URDF has no masses, and no payload or force on the tool was recorded",
    "single_joint": "the cart carries a single joint, and a rotation about it does not move the platform",
    "absorbed": "geometric calibration absorbs it",
    "small": "even many times its typical size would not show above the noise",
    "stations": "the free frame of each session absorbs it (stations in dataset.toml)",
    "unrecorded_payload": "the payload may have varied without being recorded",
    "not_searched": "a check does not search for periods and steps: diagnose as many poses as for a calibration",
    "uncertain": "the uncertainty of the earlier model and of the instrument's pose hides it",
    "other": "{words}",
}
"""Why an effect can't be tested, by kind."""
ROUGH = ChainWords(
    clause="the drive errs over its own angle, and the periods of its errors have no gear in common",
    remedy="Compensate by the curve below: no gear and no encoder has these periods.",
)
"""Words for a drive with several periods of no common gear."""
DOUBTS = {
    "description": (
        "The error at {site} is a smooth function of {columns}. This describes the error; it is no cause. To find the "
        "mechanism, diagnose regions separately and record other columns."
    ),
    "restless": "The errors of {site} differ between poses by more than the scatter of repeated visits.",
    "held_out": (
        "The errors at left-out poses exceed the noise that was declared or that repeated visits show, or the causes do not "
        "reduce them."
    ),
    "excess": (
        "The residuals are larger than the declared noise. No effect explains the difference, and too few poses were visited "
        "twice to show whether it repeats."
    ),
    "scatter": "Repeated visits scatter by more than the noise of the instrument, and the columns that could explain it "
    "contradict each other.",
    "chi_square": "The differences from the earlier model exceed noise and its uncertainty, and no change explains them.",
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


def rough(one: Cause | Member) -> bool:
    """Whether it is a drive with several periods of no common gear."""
    return isinstance(one, Cause) and one.nature == "profile" and "period" in one.parameters


def title(found: Findings, one: Cause | Member) -> str:
    """The name of a cause or a member of a class, without its site."""
    return "rough drive" if rough(one) else found.effect(one.effect).title


def cause_name(found: Findings, one: Cause | Member) -> str:
    """As :func:`named`, of a cause or a member of a class."""
    return f"{title(found, one)} at {site_words(one.site)}"


def known_as(name: str, site: str) -> str:
    """As :func:`named`, by the id of an effect; one that is not of the catalogue keeps its id."""
    return next((named(e, site) for e in catalogue() if e.id == name), f"{name} at {site_words(site)}")


def parameter(name: str, value: float, unit: str, sigma: float | None = None) -> tuple[str, str]:
    """Name and value of a parameter as text: ``half width`` and ``24.9 ± 1.1 µm``; a period of what turns as periods a turn."""
    words = _in_words(name)
    if _periodic(name, unit):
        turns = TURN / value
        return words.replace("period", "periods a turn"), quantity(turns, "", sigma and sigma * turns / value)
    return words, quantity(value, unit, sigma)


def parameter_rows(cause: Cause) -> list[list[str]]:
    """Rows of a table: the name of each parameter of a cause, its value, and the ends of its 95 % interval."""
    rows = []
    for name, e in cause.parameters.items():
        ends = [parameter(name, end, e.unit)[1] for end in e.interval]
        if _periodic(name, e.unit):
            turns = TURN / e.value
            ends = [quantity(max(end, 0.0), "") for end in Estimate(turns, e.sigma * turns / e.value, "").interval]
        rows.append([*parameter(name, e.value, e.unit, e.sigma), *ends])
    return rows


def _in_words(name: str) -> str:
    """The name of a parameter of an effect; ``end_to_end[2]`` is the change along the range of the second other drive."""
    if name.startswith("end_to_end["):
        number = name[len("end_to_end[") : -1]
        return f"{ORDINALS.get(number, f'{number}th')} other drive"
    plain, _, last = name.rpartition("_")
    return f"{plain} ({last})" if last.isdigit() else TWO_AXES.get(name, name.replace("_", " "))


def _periodic(name: str, unit: str) -> bool:
    return name.split("_")[0] == "period" and unit == "rad"


def value(name: str, estimate: Estimate) -> str:
    """A parameter with its value: ``half width 24.9 ± 1.1 µm``."""
    return " ".join(parameter(name, estimate.value, estimate.unit, estimate.sigma))


def size_words(parameters: Mapping[str, Estimate], count: int = 1) -> str:
    """The first ``count`` parameters in short, as known: ``half width 24.9 µm``; of periods ``24 a turn, 0.41 mrad``.

    Of components x, y, z the largest is given. If the first one may be zero, the one with the smallest relative sigma.
    """
    lines, turns = [], False
    for name, period in parameters.items():
        if name.split("_")[0] == "period":
            size, turns = parameters[name.replace("period", "amplitude")], period.unit == "rad"
            often = quantity(period.value, period.unit, period.sigma, alone=True)
            if turns:
                known = quantity(TURN / period.value, "", TURN * period.sigma / period.value**2, alone=True)
                often = f"{float(known):g}"
            lines.append((size.value, often, quantity(size.value, size.unit, size.sigma, alone=True)))
    if lines:
        _, periods, sizes = (list(words) for words in zip(*sorted(lines, reverse=True)[:LINES], strict=True))
        often = f"{joined(periods)} a turn" if turns else f"every {joined(periods)}"
        more = f", and {len(lines) - LINES} more" if len(lines) > LINES else ""
        return f"{often}, {joined(sizes)}{more}"
    some = list(parameters.items())[:count]
    if count == 1 and some and some[0][0].endswith("_x"):
        along = [one for one in parameters.items() if one[0][:-1] == some[0][0][:-1]]
        some = [max(along, key=lambda one: abs(one[1].value))]
    if count == 1 and some and abs(some[0][1].value) < WIDE * some[0][1].sigma:
        some = [max(parameters.items(), key=lambda one: abs(one[1].value) / max(one[1].sigma, 1e-300))]
    return ", ".join(f"{_in_words(name)} {quantity(e.value, e.unit, e.sigma, alone=True)}" for name, e in some)


def sized(found: Findings, one: Cause | Member, words: str) -> str:
    """Words for a cause or a member of a class, followed by its size where it is known."""
    if rough(one):
        sizes = [e for name, e in one.parameters.items() if name.startswith("amplitude")]
        whole = float(np.sqrt(sum(e.value**2 for e in sizes) / 2.0))
        return f"{words}, {quantity(whole, sizes[0].unit)} RMS, {len(sizes)} periods without a common gear"
    return ", ".join(filter(None, (words, size_words(one.parameters, 1 + found.effect(one.effect).has_nonlinear))))


def explained_words(found: Findings, cause: Cause) -> str:
    """The part of an error that a cause explains: its root mean square, of positions; else its share of the power.

    With a share f of the power g^2 = before^2 - floor^2 beyond noise, the root mean square is g sqrt(f). Empty where the error
    does not exceed the noise.
    """
    power = found.gap.before**2 - found.gap.floor**2
    if power <= 0.0:
        return ""
    if found.gap.by_instrument:
        return percent(cause.explained_fraction)
    return length(float(np.sqrt(power * max(cause.explained_fraction, 0.0))))


def explained_part(found: Findings, cause: Cause) -> str:
    """The part of an error that a cause explains: ``38.1 µm, 49 %``, its size and its share of the power beyond noise."""
    sizes = dict.fromkeys((explained_words(found, cause), percent(cause.explained_fraction)))
    return ", ".join(sizes) if "" not in sizes else ""


def cause_rows(found: Findings) -> list[list[str]]:
    """Rows of a table: causes with probability, parameters and the part of the error that they explain, each followed by its
    class, and by what is left of the probability."""
    rows = []
    for cause in found.causes:
        for i, together in enumerate(options(cause)):
            first, starts = together[0], ("  or " if i else "", *["  with "] * len(together))
            name = "\n".join(
                f"{start}{title(found, one)}\n{'     ' if start else '  '}at {site_words(one.site)}"
                for start, one in zip(starts, together, strict=False)
            )
            own, shown = [value(*one) for one in first.parameters.items()], SHOWN if first is cause else LINES
            more = [f"and {len(own) - shown} more"] if first is cause and len(own) > shown else []
            part = explained_part(found, cause) if first is cause else ""
            rows.append([name, chance(_probability(together)), "\n".join(own[:shown] + more), part])
        left = 1.0 - sum(member.probability for member in cause.members)
        if left >= CLASS_SHARE:
            rows.append(["  or something else", chance(left), "", ""])
    return rows


def options(cause: Cause) -> list[tuple[Cause | Member, ...]]:
    """What could be the cause, the most probable first: the cause, and each alternative."""
    return sorted([(cause,), *alternatives(cause)], key=lambda one: -_probability(one))


def _probability(together: Iterable[Cause | Member]) -> float:
    return sum(one.probability for one in together)


def alternatives(cause: Cause) -> list[tuple[Member, ...]]:
    """The other members of a class; those that only together could be the cause are one alternative."""
    by_place, found = {(m.effect, m.site): m for m in others(cause)}, list[tuple[Member, ...]]()
    for m in by_place.values():
        together = [m]
        while (one := by_place.get(together[-1].beside or ("", ""))) is not None and one not in together:
            together.append(one)
        closed = together[-1].beside == (m.effect, m.site)  # each beside the next, the last beside the first
        if not any(m in known for known in found):
            found.append(tuple(together) if closed else (m,))
    return found


def cause_lines(found: Findings, noun: str = "gap", most: int = LINES) -> list[str]:
    """A line for each cause, the certain ones first, then those that explain most; the last line has all that are left.

    ``noun``: the error that they explain. ``most``: largest number of lines.
    """
    sure, doubtful = sure_and_doubtful(sorted(found.causes, key=lambda c: -c.explained_fraction))
    every = [*sure, *doubtful]
    first = every if len(every) <= most else every[: most - 1]
    lines = [_line(found, cause, noun) for cause in first]
    if rest := every[len(first) :]:
        sizes = [(cause_name(found, c), explained_words(found, c)) for c in rest]
        more = joined([f"{words} ({size})" if size else words for words, size in sizes])
        lines.append(f"{'Also' if lines else 'Causes:'} {more}")
    return [f"{line}." for line in lines]


def _line(found: Findings, cause: Cause, noun: str) -> str:
    """A cause with its size, and the first other members of its class where it is not certain."""
    size, sure = explained_words(found, cause), cause.probability >= SURE
    share = f"{size} of the {noun}" if size else ""
    if sure or len(cause.members) == 1:
        how = "; ".join(filter(None, ("certain" if sure else f"probable, {chance(cause.probability)}", share)))
        said = f"{site_words(cause.site)}: {sized(found, cause, title(found, cause))} ({how})"
        return said if cause.site not in SITES else capital(said)
    every = [
        " with ".join(
            sized(found, one, cause_name(found, one)) if one is cause else cause_name(found, one) for one in some
        )
        + f" ({chance(_probability(some))})"
        for some in options(cause)
    ]
    first, second, probable = *every[:2], cause.probability >= PROBABLE
    if len(every) > 2:
        second = f"{'' if probable else 'one of '}{len(every) - 1} others"
    words = ", ".join(filter(None, ("Probable" if probable else "Open", share)))
    if probable:
        return f"{words}: {first}; not excluded: {second}"
    return f"{words}: {first} or {second}"


def badge(found: Findings) -> str:
    """The numbers of certain, open and unknown causes in short: ``1 certain, 1 open``; empty where there is none."""
    sure, doubtful = map(len, sure_and_doubtful(found.causes))
    counts = ((sure, "certain"), (doubtful, "open"), (int(found.verdict == "unknown"), "unknown"))
    return ", ".join(f"{count} {word}" for count, word in counts if count)


def overlap(found: Findings) -> str:
    """A sentence where the causes' shares do not sum to what they explain together; else empty."""
    whole, shares = found.gap.explained_fraction, [c.explained_fraction for c in found.causes]
    if whole is None or len(shares) < 2 or abs(sum(shares) - whole) < OVERLAP:
        return ""
    return (
        "The shares of the causes overlap: each is what this cause explains in addition to the others. Together they explain "
        f"{percent(whole)}."
    )
