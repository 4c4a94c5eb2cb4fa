"""The verdict of a diagnosis in a sentence that an engineer can act on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from gtpin.diagnosis.planning.measurement_conditions import kind
from gtpin.diagnosis.result import Cause, Considered, Diagnosis, Question
from gtpin.report.phrases import clause, sentence
from gtpin.report.quality import scatters
from gtpin.report.reasons import reason_words
from gtpin.report.words import (
    chance,
    coordinate_words,
    counted,
    joined,
    length,
    number_word,
    percent,
    quantity,
    site_words,
)

SURE = 0.95
"""Probability from which a cause stands alone."""
LISTED = 3
"""Effects that could be the unknown, of which the best are listed."""
BADGES = {
    "none": ("no cause", "good"),
    "explained": ("cause found", "accent"),
    "ambiguous": ("can't be told apart", "warn"),
    "unknown": ("unknown cause", "mystery"),
}


@dataclass(frozen=True)
class Verdict:
    """The first words of the page: a badge with its colour, a headline, and what to do."""

    badge: str
    tone: str
    headline: str
    advice: tuple[str, ...]


def verdict(diagnosis: Diagnosis) -> Verdict:
    """Say what a diagnosis says."""
    headline, advice = {"none": _none, "explained": _explained, "ambiguous": _ambiguous, "unknown": _unknown}[
        diagnosis.verdict
    ](diagnosis)
    badge, tone = BADGES[diagnosis.verdict]
    return Verdict(badge, "warn" if may_hide(diagnosis) else tone, headline, (*advice, *questions(diagnosis)))


def _none(d: Diagnosis) -> tuple[str, list[str]]:
    gap = (
        f"The calibrated geometry leaves {length(d.gap.before)} RMS on poses that it was not fitted to; instrument and "
        f"repeatability alone give {length(d.gap.floor)}."
    )
    scatter, hidden = scatters(d.baseline), may_hide(d)
    if scatter and hidden:
        headline = (
            "Nothing beyond noise is seen, but much of this noise is scatter between visits, and what may be behind it "
        )
        return headline + "could not be tested.", [gap, scatter, *hidden]
    advice = [f"{gap} Use it as it is: nothing calls for a compensation."]
    untestable = sum(not c.testable for c in d.candidates)
    if untestable:
        advice.append(
            f"{counted(untestable, 'candidate')} could not be tested with these data; a cause among them would not show."
        )
    return "Nothing but noise is left: the calibrated geometry explains these measurements.", advice


def may_hide(d: Diagnosis) -> list[str]:
    """What comes and goes between visits, and could not be tested for lack of a covariate, where visits scatter."""
    if d.verdict != "none" or not scatters(d.baseline):
        return []
    lacking = [c for c in d.candidates if d.effect(c.effect).between_visits and _is_missing(c)]
    effects = list(dict.fromkeys(c.effect for c in lacking))
    columns = list(
        dict.fromkeys(name for c in lacking for name in d.effect(c.effect).covariates(d.model.robot, c.site))
    )
    if not effects:
        return []
    return [
        f"{joined(effects)} could not be tested: record {joined(columns)}, or fill in what is known, and diagnose again."
    ]


def _is_missing(c: Considered) -> bool:
    return c.reason is not None and c.reason.kind == "missing"


def _explained(d: Diagnosis) -> tuple[str, list[str]]:
    clauses = _clauses(d, d.causes)
    several = f"{number_word(len(clauses))} causes: " if len(clauses) > 1 else ""
    return sentence(several + joined(clauses)), [*_remedies(d, d.causes), _shrinks(d)]


def _ambiguous(d: Diagnosis) -> tuple[str, list[str]]:
    sure, doubtful = _by_doubt(d.causes)
    headline = " ".join(sentence(_either(d, cause)) for cause in doubtful)
    if sure:
        headline += f" Sure beside it: {joined(_clauses(d, sure))}."
    advice = [_shrinks(d), *not_recorded(d)]
    if len(advice) == 1:
        advice.append("Which of them it is makes no difference to what the model predicts near these poses.")
    members = {f"{m.effect}@{m.site}" for cause in doubtful for m in cause.members}
    return headline, [*_remedies(d, sure), *advice, *_next(d, members)]


def not_recorded(d: Diagnosis) -> list[str]:
    """What members of a class can't be ruled out for lack of a covariate, and how to mend that."""
    lacking = dict.fromkeys((m.effect, m.site) for c in _by_doubt(d.causes)[1] for m in c.members if not m.recorded)
    return [
        f"{joined(_names(rows), 'or')} can't be ruled out, because {reason}: record it, or fill in what is known of it"
        f"{_at_rest(rows)}, and diagnose again."
        for reason, rows in _by_reason(d, lacking).items()
    ]


def questions(d: Diagnosis) -> list[str]:
    """What parameters outside the expected make doubtful, and what to check."""
    return [_question(q) for q in d.questions]


def _question(q: Question) -> str:
    value = f"{q.parameter.replace('_', ' ')} {quantity(q.value, q.unit, q.sigma)}"
    check = "Check unit and sign of the columns that it depends on"
    if q.believed:
        return f"{q.effect} at {site_words(q.site)} has {value}, which is unusual: {q.why}. {check}."
    return (
        f"{q.effect} at {site_words(q.site)} would have {value}, which is not possible: {q.why}. It is not named as a cause. "
        f"{check}."
    )


def _by_reason(d: Diagnosis, effects: Iterable[tuple[str, str]]) -> dict[str, list[Considered]]:
    """Effects at their sites, by why these data can't tell, in words."""
    rows = {(c.effect, c.site): c for c in d.candidates if c.reason}
    found: dict[str, list[Considered]] = {}
    for effect in effects:
        if effect in rows:
            found.setdefault(reason_words(rows[effect].reason, rows[effect].site), []).append(rows[effect])
    return found


def _names(rows: Iterable[Considered]) -> list[str]:
    return [f"{c.effect} at {site_words(c.site)}" for c in rows]


def _at_rest(rows: Iterable[Considered]) -> str:
    speeds = any(c.reason is not None and kind(c.reason.covariate) == "speed" for c in rows)
    return " (0 where the machine stood still)" if speeds else ""


def _unknown(d: Diagnosis) -> tuple[str, list[str]]:
    what = (
        "something that these data can't name"
        if d.unexplained.could_be
        else "something that the catalogue does not know"
    )
    if d.unexplained.correlates:
        site, coordinates, _ = d.unexplained.correlates[0]
        moved = "everything that the instrument sees" if site == "frame" else site_words(site)
        headline = sentence(f"{what} moves {moved} with {coordinate_words(coordinates)}: don't compensate it by name")
        look = f"Look for what could move {moved} with {coordinate_words(coordinates)}; the plots below show how."
    else:
        headline = sentence(f"{what} is in these measurements: don't compensate it by name")
        look = "It goes with no single coordinate that was recorded; the maps below show where it is."
    advice = [look, *could_be(d)]
    if d.causes:
        sure = joined(_clauses(d, d.causes))
        advice += [f"Sure beside it: {sure}.", *_remedies(d, d.causes), _shrinks(d)]
    else:
        advice.append(
            "The corrected model is the calibrated geometry alone: no known effect is sure enough to be in it."
        )
    return headline, [*advice, *_next(d, {"unknown"})]


def could_be(d: Diagnosis) -> list[str]:
    """What these data can't tell, for lack of a covariate, but would account for the unknown."""
    return [
        f"It could be {joined(_names(rows), 'or')}, which these data can't tell: {reason}."
        for reason, rows in _by_reason(d, d.unexplained.could_be[:LISTED]).items()
    ]


def _next(d: Diagnosis, separates: set[str]) -> list[str]:
    """The first measurement that would tell some things apart."""
    steps = (e for e in d.next_experiment if separates.intersection(e.separates))
    return [e.measure for e in steps][:1]


def _by_doubt(causes: tuple[Cause, ...]) -> tuple[list[Cause], list[Cause]]:
    sure = [c for c in causes if c.probability >= SURE]
    return sure, [c for c in causes if c.probability < SURE]


def _either(d: Diagnosis, cause: Cause) -> str:
    """What a doubtful cause may be."""
    named = [f"{clause(d.effect(m.effect), m.site)} ({chance(m.probability)})" for m in cause.members]
    if len(named) == 1:
        return f"probably {named[0]}, but these data don't settle it"
    others = f"one of {len(named) - 3} others" if len(named) > 4 else "another"
    more = f", or {others}" if len(named) > 3 else ""
    return f"{joined(named[:3], 'or')}{more}: these data can't tell"


def _clauses(d: Diagnosis, causes: Iterable[Cause]) -> list[str]:
    return [clause(d.effect(c.effect), c.site) for c in causes]


def _remedies(d: Diagnosis, causes: tuple[Cause, ...] | list[Cause]) -> list[str]:
    if len(causes) == 1:
        return [d.effect(causes[0].effect).remedy]
    return [sentence(f"{site_words(c.site)}: {_lower(d.effect(c.effect).remedy)}") for c in causes]


def _lower(remedy: str) -> str:
    """A remedy as the rest of a sentence."""
    return remedy[:1].lower() + remedy[1:].rstrip(".")


def _shrinks(d: Diagnosis) -> str:
    gap = d.gap
    if gap.shrinkage is None:
        return "How far the gap shrinks can't be told from these data."
    before, after, floor = length(gap.before), length(gap.after), length(gap.floor)
    if gap.before <= gap.floor:
        return (
            f"The gap, {before}, is below the noise that these data are taken to have, {floor}: how far it shrinks can't "
            f"be told well. The corrected model leaves {after}."
        )
    interval = f" (95\u00a0% interval {_range(gap.interval)})" if gap.interval else ""
    return (
        f"On poses that it was not fitted to, the corrected model brings the gap from {before} to {after}, where noise alone "
        f"gives {floor}: {percent(gap.shrinkage)} of its power beyond noise{interval}."
    )


def _range(interval: tuple[float, float]) -> str:
    return f"{percent(interval[0])} to {percent(interval[1])}"
