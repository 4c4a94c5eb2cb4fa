"""Candidates by their evidence, classes of causes that can't be distinguished, and untestable effects."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from gtpin.diagnosis.inference.findings import Cause, Considered, Member
from gtpin.diagnosis.result import Diagnosis
from gtpin.effects.effect import Effect
from gtpin.report.page import Table
from gtpin.report.phrases import clause, reason_words, sentence
from gtpin.report.words import chance, counted, joined, percent, quantity, site_words, whole
from gtpin.robot.robot import Robot

SHOWN = 12
"""Number of candidates with a bar; the others are in a table."""


@dataclass(frozen=True)
class Bar:
    """A bar: name, length relative to the longest, value as text, and whether it is a named cause."""

    name: str
    share: float
    value: str
    lead: bool = False


@dataclass(frozen=True)
class NamedCause:
    """A named cause as it is shown on the page: texts, the table of its parameters, and the bars of its class."""

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
    """Gain in log evidence of geometry with each single candidate over geometry alone: bars and a table."""
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
        Size of each effect as text, by effect and site.
    """
    estimable = d.gap.before > d.gap.floor
    return [
        _named(f"cause-{k + 1}", c, d.model.robot, d.effect(c.effect), reach.get((c.effect, c.site), ""), estimable)
        for k, c in enumerate(d.causes)
    ]


def _named(key: str, c: Cause, robot: Robot, effect: Effect, reach: str, estimable: bool) -> NamedCause:
    rows = [[name.replace("_", " "), quantity(e.value, e.unit, e.sigma)] for name, e in c.parameters.items()]
    members = tuple(
        Bar(_name(m), m.probability, chance(m.probability), (m.effect, m.site) == (c.effect, c.site)) for m in c.members
    )
    words = sentence(clause(effect, c.site, robot))
    shrinkage = percent(c.shrinkage) if estimable else "not estimable"
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
    """The nonlinear parameter of a cause, such as a period, as text; it is the first of the parameters."""
    if not effect.has_nonlinear:
        return ""
    name, setting = next(iter(c.parameters.items()))
    return f"{name.replace('_', ' ')} {quantity(setting.value, setting.unit)}"


def untestable(candidates: Sequence[Considered]) -> Table:
    """Effects that could not be tested, with the reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for c in candidates:
        if not c.testable:
            reasons.setdefault((c.effect, reason_words(c.reason, c.site)), []).append(site_words(c.site))
    return Table(
        ("effect", "at", "why not"), [[effect, joined(sites), reason] for (effect, reason), sites in reasons.items()]
    )


def testable_count(d: Diagnosis) -> str:
    """Number of tested candidates."""
    return counted(sum(c.testable for c in d.candidates), "candidate")


def _name(c: Considered | Member) -> str:
    return f"{c.effect} at {site_words(c.site)}"


def meaning(effect: Effect) -> tuple[Markup, ...]:
    """Equation, signs and parameters of an effect, a paragraph each; empty without a docstring.

    Paragraphs on typical sizes are omitted, because the data have determined the size.
    """
    text = inspect.cleandoc(type(effect).__dict__.get("__doc__") or "")
    paragraphs = [" ".join(part.split()) for part in text.split("\n\n")]
    return tuple(_marked(part) for part in paragraphs if part and not part.startswith("Typical size"))


def _marked(text: str) -> Markup:
    """A paragraph with its names set as code, and references to classes as the class name."""
    plain = re.sub(r":\w+:`~?(?:[\w.]+\.)?(\w+)`", r"``\1``", text)
    parts = plain.split("``")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 else escape(part) for i, part in enumerate(parts)
    )
