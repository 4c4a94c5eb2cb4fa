"""The causes with their parameters and curves, what can't be distinguished from them, and what to measure next."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence

from markupsafe import Markup, escape

from gtpin.diagnosis.result import Findings
from gtpin.effects.effect import Effect
from gtpin.report.effect_curves import EffectCurve, curve_notes, curve_plots, reach
from gtpin.report.fit import FitPresentation
from gtpin.report.next_experiment import experiment_notes
from gtpin.report.page import Bar, Bars, Block, Fold, Heading, Plots, Section, Table
from gtpin.report.phrases import (
    ROUGH,
    cause_name,
    clause,
    explained_part,
    named,
    of_robot,
    others,
    parameter_rows,
    rough,
    sentence,
)
from gtpin.report.words import capital, chance
from gtpin.robot.chain import Chain


def the_causes(r: FitPresentation) -> Section | None:
    """Each cause with its parameters, what they mean, and its curves."""
    d = r.diagnosis
    if d is None or not d.causes:
        return None
    return Section("causes", "The causes", causes_of(d, r.curves))


def causes_of(found: Findings, curves: Mapping[tuple[str, str], Sequence[EffectCurve]]) -> list[Block]:
    """Each cause of a diagnosis, or change of a check, with its parameters and what they mean; ``curves``: of each, by effect
    and site."""
    content: list[Block] = []
    given = ", given the others" if len(found.causes) > 1 else ""
    for k, c in enumerate(found.causes):
        effect, drawn = found.effect(c.effect), curves.get((c.effect, c.site), ())
        what = ROUGH.clause if rough(c) else clause(effect, c.site, found.model.robot)
        words = (
            f"{sentence(what)} Its name in files and for --exclude: {c.effect}@{c.site}. "
            f"Probability {chance(c.probability)}."
        )
        if part := explained_part(found, c):
            words += f" It explains of the error beyond noise{given}: {part}."
        if far := reach(drawn):
            words += f" {capital(far)}."
        table = Table(("parameter", "value", "95 % from", "to"), parameter_rows(c), (2, 3))
        content += [Heading(cause_name(found, c)), words, table]
        if paragraphs := meaning(effect, found.model.robot):
            content.append(Fold("What they mean", paragraphs))
        if drawn:
            content += [Plots(curve_plots(f"cause-{k + 1}", drawn)), *curve_notes(drawn)]
    return content


def meaning(effect: Effect, robot: Chain) -> tuple[Markup, ...]:
    """Equation, signs and parameters of an effect at a robot, a paragraph each; empty without a docstring.

    Paragraphs on typical sizes are omitted, because the data have determined the size.
    """
    text = inspect.cleandoc(type(effect).__dict__.get("__doc__") or "")
    paragraphs = of_robot([" ".join(part.split()) for part in text.split("\n\n")], robot)
    return tuple(_marked(part) for part in paragraphs if part and not part.startswith("Typical size"))


def _marked(text: str) -> Markup:
    """A paragraph with its names set as code, and references to classes as the class name."""
    parts = re.sub(r":\w+:`~?(?:[\w.]+\.)?(\w+)`", r"``\1``", text).split("``")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 else escape(part) for i, part in enumerate(parts)
    )


def what_can_t_be_distinguished(r: FitPresentation) -> Section | None:
    """Classes of causes that can't be distinguished, and what to measure next."""
    if (d := r.diagnosis) is None:
        return None
    content: list[Block] = []
    for c in (c for c in d.causes if len(c.members) > 1):
        bars = [
            Bar(named(d.effect(m.effect), m.site), m.probability, chance(m.probability), m not in others(c))
            for m in c.members
        ]
        content += ["These effects give nearly the same residuals in these data. Probabilities:", Bars([("", bars)])]
    if not d.causes:
        content.append("No cause is named, so there are no alternatives to distinguish.")
    elif not content:
        content.append("Each cause is unique: no other effect of the catalogue explains these data as well.")
    title = "What can't be distinguished, and what to measure next"
    return Section("apart", title, [*content, *experiment_notes(d)], "What to measure next")
