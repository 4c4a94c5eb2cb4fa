"""The causes with their parameters and curves, what can't be told apart from them, and what to measure next."""

from __future__ import annotations

import inspect
import re

from markupsafe import Markup, escape

from gtpin.compensation.correctable import correctable
from gtpin.diagnosis.result import Diagnosis
from gtpin.effects.effect import Effect
from gtpin.report.effect_curves import curve_notes, curve_plots
from gtpin.report.next_experiment import experiment_notes
from gtpin.report.page import Bar, Bars, Block, Fold, Heading, Note, Plots, Section, Small, Table
from gtpin.report.phrases import SURE, clause, named, of_robot, others, parameter, sentence
from gtpin.report.sections import Reported, section
from gtpin.report.verdict import verdict
from gtpin.report.words import chance, joined, percent
from gtpin.robot.chain import Chain

PROGRAM = Markup("<code>gtpin export DIR/model --commands program.csv -o corrected.csv</code>")
TABLES = Markup(
    "<code>gtpin export DIR/model -o corrections.csv</code> writes them as a table for each actuator, <code>-o corrections.comp"
    "</code> for LinuxCNC; {} corrects a program for everything that the model knows. The tables are for a controller that has "
    "the calibrated geometry: one with the nominal geometry needs corrected programs. DIR is this report's folder."
)
WHOLE = Markup(
    "No table for single actuators corrects this, but whole programs can be corrected for everything that the model knows: {}, "
    "DIR being this report's folder."
)


@section(20)
def the_causes(r: Reported) -> Section | None:
    """Each cause with its parameters, what they mean, and its curves; then how a controller corrects them."""
    d = r.diagnosis
    if d is None or not d.causes:
        return None
    content: list[Block] = []
    given = ", given the other causes" if len(d.causes) > 1 else ""
    for k, c in enumerate(d.causes):
        effect, found = d.effect(c.effect), r.curves.get((c.effect, c.site), ())
        rows = [parameter(name, e.value, e.unit, e.sigma) for name, e in c.parameters.items()]
        told = (
            f"{sentence(clause(effect, c.site, d.model.robot))} Its name in files and for --exclude: {c.effect}@{c.site}. "
            f"Probability {chance(c.probability)}."
        )
        if d.gap.before > d.gap.floor:
            told += f" It explains {percent(c.explained_fraction)} of the gap's power beyond noise{given}."
        content += [Heading(named(effect, c.site), f"cause-{k + 1}"), told, Table(("parameter", "value"), rows)]
        if paragraphs := meaning(effect, d.model.robot):
            content.append(Fold("What they mean", [Small(words) for words in paragraphs]))
        if found:
            content += [Plots(curve_plots(f"cause-{k + 1}", found)), *map(Small, curve_notes(found))]
    if kept := sure_corrections(d):
        content.append(Note([f"A controller can correct {joined(kept)} by itself.", TABLES.format(PROGRAM)]))
    elif verdict(d).tone == "accent":
        content.append(Note([WHOLE.format(PROGRAM)]))
    return Section("causes", "The causes", content)


def sure_corrections(d: Diagnosis) -> list[str]:
    """Certain causes that a controller with the calibrated geometry can correct, with tables for single actuators that
    ``gtpin export`` writes."""
    sure = {(c.effect, c.site) for c in d.causes if c.probability >= SURE}
    kept = [active for active in correctable(d.model) if (active.effect.id, active.site) in sure]
    return [named(active.effect, active.site) for active in kept]


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


@section(90)
def what_can_t_be_told_apart(r: Reported) -> Section | None:
    """Classes of causes that can't be distinguished, and what to measure next."""
    if (d := r.diagnosis) is None:
        return None
    content: list[Block] = []
    for c in (c for c in d.causes if len(c.members) > 1):
        bars = [
            Bar(named(d.effect(m.effect), m.site), m.probability, chance(m.probability), m not in others(c))
            for m in c.members
        ]
        content += ["These effects give nearly the same residuals in these data. Probabilities:", Bars(bars)]
    if not d.causes:
        content.append("No cause is named, so there are no alternatives to distinguish.")
    elif not content:
        content.append("Each cause is unique: no other effect of the catalogue explains these data as well.")
    if d.verdict == "explained":
        confirm = (
            "To confirm it: remove the cause on the machine, or load the corrections. Then measure as many poses of the same "
            "kind again and diagnose them: only noise should remain."
        )
        content.append(Note([confirm]))
    title = "What can't be told apart, and what to measure next"
    return Section("apart", title, [*content, *experiment_notes(d)], "What to measure next")
