"""Candidates by their evidence, classes that can't be told apart, and what could not be tested."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from gtpin.diagnosis.inference.findings import Cause, Considered, Member
from gtpin.diagnosis.result import Diagnosis
from gtpin.effects.effect import Effect
from gtpin.report.meaning import meaning
from gtpin.report.page import Table
from gtpin.report.phrases import clause, sentence
from gtpin.report.reasons import reason_words
from gtpin.report.words import chance, counted, joined, percent, quantity, site_words, whole

SHOWN = 12
"""Candidates whose bars are drawn; the others are in a table."""


@dataclass(frozen=True)
class Bar:
    """A bar: name, share of the longest, value in words, and whether it stands for a cause."""

    name: str
    share: float
    value: str
    lead: bool = False


@dataclass(frozen=True)
class NamedCause:
    """A cause as the page shows it."""

    key: str
    words: str
    effect: str
    site: str
    place: str
    probability: str
    shrinkage: str
    reach: str
    parameters: Table
    meaning: tuple[Markup, ...]
    members: tuple[Bar, ...]


def evidence_bars(d: Diagnosis) -> tuple[list[Bar], Table]:
    """Gains in log evidence of each candidate alone beside geometry: bars of the largest, and a table of the others."""
    named = {(c.effect, c.site) for c in d.causes}
    tested = sorted((c for c in d.candidates if c.testable), key=lambda c: -c.log_evidence)
    top = max([c.log_evidence for c in tested], default=0.0)
    bars = [
        Bar(
            _name(c),
            max(c.log_evidence, 0.0) / top if top > 0.0 else 0.0,
            whole(f"{c.log_evidence:.1f}"),
            (c.effect, c.site) in named,
        )
        for c in tested[:SHOWN]
    ]
    rest = [[_name(c), whole(f"{c.log_evidence:.1f}")] for c in tested[SHOWN:]]
    return bars, Table(("candidate", "gain in log evidence"), rest)


def named_causes(d: Diagnosis, reach: Mapping[tuple[str, str], str]) -> list[NamedCause]:
    """The causes with their classes and parameters.

    Parameters
    ----------
    reach
        How much each moves, in words, by effect and site.
    """
    told = d.gap.before > d.gap.floor
    return [
        _named(f"cause-{k + 1}", c, d.effect(c.effect), reach.get((c.effect, c.site), ""), told)
        for k, c in enumerate(d.causes)
    ]


def _named(key: str, c: Cause, effect: Effect, reach: str, told: bool) -> NamedCause:
    rows = [[name.replace("_", " "), quantity(e.value, e.unit, e.sigma)] for name, e in c.parameters.items()]
    members = tuple(
        Bar(_name(m), m.probability, chance(m.probability), (m.effect, m.site) == (c.effect, c.site)) for m in c.members
    )
    words = sentence(clause(effect, c.site))
    shrinkage = percent(c.shrinkage) if told else "can't be told"
    return NamedCause(
        key,
        words,
        c.effect,
        c.site,
        site_words(c.site),
        chance(c.probability),
        shrinkage,
        "; ".join(word for word in (_nonlinear(c, effect), reach) if word),
        Table(("parameter", "value"), rows),
        meaning(effect),
        members,
    )


def _nonlinear(c: Cause, effect: Effect) -> str:
    """What is not linear in a cause, its period or place, in words; its parameters begin with it."""
    if not effect.has_nonlinear:
        return ""
    name, setting = next(iter(c.parameters.items()))
    return f"{name.replace('_', ' ')} {quantity(setting.value, setting.unit)}"


def untestable(candidates: Sequence[Considered]) -> Table:
    """What could not be tested, by its reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for c in candidates:
        if not c.testable:
            reasons.setdefault((c.effect, reason_words(c.reason, c.site)), []).append(site_words(c.site))
    return Table(
        ("effect", "at", "why not"), [[effect, joined(sites), reason] for (effect, reason), sites in reasons.items()]
    )


def testable_count(d: Diagnosis) -> str:
    """How many candidates were tried."""
    return counted(sum(c.testable for c in d.candidates), "candidate")


def _name(c: Considered | Member) -> str:
    return f"{c.effect} at {site_words(c.site)}"
