"""The page of a diagnosis: the verdict first, then the evidence for it."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence

from markupsafe import Markup, escape

from gtpin.calibration.checks.prepared import with_positions
from gtpin.compensation.corrections import correctable
from gtpin.data import Dataset
from gtpin.diagnosis.inference.findings import Cause, Considered, Member
from gtpin.diagnosis.inference.where import Where
from gtpin.diagnosis.result import Diagnosis
from gtpin.effects.effect import Effect
from gtpin.report.curve_plots import curve_notes, curve_plots, reach
from gtpin.report.diagnosis_json import gap_method
from gtpin.report.effect_curves import EffectCurve, curves
from gtpin.report.embedded import PlotChoice
from gtpin.report.geometry_table import controller_blocks, doubt_of, geometry_tables
from gtpin.report.instruments_table import gap_table, unknowns_table
from gtpin.report.next_experiment import experiment_notes
from gtpin.report.page import Bar, Bars, Block, Fold, Heading, Lead, Note, Plots, Section, Small, Table, report
from gtpin.report.phrases import SURE, clause, named, of_robot, others, parameter, reason_words, sentence, size_words
from gtpin.report.provenance import provenance
from gtpin.report.quality import nominal_words, quality
from gtpin.report.residual_columns import View, commanded, leading
from gtpin.report.residual_plots import LAYERS, ONE_LAYER, against_columns, components, over_two
from gtpin.report.residual_sections import (
    circle_sections,
    column_section,
    data_section,
    instrument_sections,
    map_section,
)
from gtpin.report.residuals import Residuals
from gtpin.report.sketch import drawing
from gtpin.report.verdict import gap_words, verdict
from gtpin.report.words import (
    chance,
    coordinate_words,
    joined,
    length,
    percent,
    quantity,
    short,
    site_words,
    typeset,
    whole,
)
from gtpin.robot.robot import Robot

CHANCE = 0.01
"""Smallest p-value at which noise alone explains what is left."""
ALIKE = 0.02
"""Relative difference of two noise floors that is not told."""
SHOWN = 12
"""Number of candidates with a bar; the others are in a table."""
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


def diagnosis_page(d: Diagnosis, dataset: Dataset, *, seed: int = 0) -> str:
    """The whole report of a diagnosis as one self-contained HTML file; ``seed``: that of the diagnosis, to be recorded."""
    robot, causes = d.baseline.model.robot, bool(d.causes)
    dataset = with_positions(dataset, robot)
    residuals = Residuals.of(dataset, d.baseline, d.model, d.set_aside_rows)
    sites = [c.site for c in d.causes] or [site for site, _, _ in d.unexplained.correlates]
    views, component = components(residuals, leading(residuals, sites, d.where.axis))
    layers = LAYERS if causes else ONE_LAYER
    against = against_columns(residuals, d.where.covariate, views, (component, layers))
    by_cause = {(a.effect.id, a.site): curves(a, residuals) for a in d.model.effects}
    reaches = [_reach(d, cause, by_cause) for cause in d.causes]
    sections = [
        _where(d),
        *([_causes(d, by_cause)] if causes else []),
        _left(d, residuals, views, component),
        *instrument_sections(gap_table(d.gap), unknowns_table(d.model, d.baseline)),
        *circle_sections(residuals, causes),
        map_section(residuals, layers),
        column_section(residuals, against, (layers, component), causes),
        _evidence(d),
        _apart(d),
        _untestable(d),
        _parameters(d),
        data_section(
            quality(dataset, d.baseline, d.set_aside_rows),
            Small(f"The gap is computed on poses that were not fitted: {gap_method(d.gap)}. {_two_floors(d)}".rstrip()),
        ),
    ]
    return report(f"{robot.name}: {d.verdict}", _lead(d, dataset, reaches), sections, provenance(dataset, robot, seed))


def _two_floors(d: Diagnosis) -> str:
    """A sentence where the noise floor is not that of the calibration: repeated visits differ by less without the causes."""
    calibrated = None if d.gap.by_instrument else d.baseline.to_json()["position_noise_floor"]
    if calibrated is None or abs(calibrated / d.gap.floor - 1.0) < ALIKE:
        return ""
    return (
        f"Noise alone is {length(d.gap.floor)}, as left-out poses show it given the causes; the calibration counts "
        f"{length(calibrated)} as noise."
    )


def _lead(d: Diagnosis, dataset: Dataset, reaches: Sequence[str]) -> Lead:
    """The verdict, a drawing of the machine, the key figures and the causes."""
    told, q = verdict(d), dataset.q.mean(axis=0)
    caption = "No part of the machine stands out."
    if d.verdict == "none":
        sketch = drawing(d.model, q)
    else:
        sketch = drawing(d.model, q, d.where.site, d.where.rod, [c.site for c in d.causes])
        caption = (
            "Redder: a motion of this part alone would explain more of the gap. One scale for all parts; shares from 5 % are "
            f"shown.{' Ringed or edged in blue: the sites of the causes.' if d.causes else ''}"
        )
    rows = []
    for k, (cause, size) in enumerate(zip(d.causes, reaches, strict=True)):
        link = Markup('<a href="#cause-{}">{}</a>').format(k + 1, d.effect(cause.effect).title)
        also = "; ".join(_other(d, m) for m in others(cause)) or "nothing else"
        rows.append([link, site_words(cause.site), chance(cause.probability), _explains(d, cause), size, also])
    head = ("cause", "at", "probability", "explains of the gap", "size", "could also be")
    return Lead(
        f"Diagnosis of {d.model.robot.name} · {len(dataset)} measurements",
        told.headline,
        told.advice,
        _numbers(d),
        told.badge,
        told.tone,
        sketch,
        caption,
        [Table(head, rows, (2, 3), wide=(4, 5))] if rows else [],
    )


def _numbers(d: Diagnosis) -> list[tuple[str, str]]:
    """The key figures under the headline."""
    numbers = []
    if len(d.gap.by_instrument) > 1:
        for one in d.gap.by_instrument:
            before, after, floor = (quantity(value, one.unit) for value in (one.before, one.after, one.floor))
            words = f"{one.name}, gap of the calibrated geometry{', and with the causes' if d.causes else ''}"
            numbers.append((f"{before} → {after}" if d.causes else before, f"{words}; noise alone {floor}"))
    else:
        size, left = gap_words(d.gap), d.baseline.model.unexplained
        numbers.append((nominal_words(d.baseline), "nominal geometry, RMS"))
        numbers.append((size.before, "calibrated geometry, at left-out poses"))
        numbers += [(size.after, "with the causes")] if d.causes else []
        known = left is None or left.noise_known
        numbers.append((size.floor, "noise alone" if known else "left of the fit: the noise is not known"))
    if d.gap.explained_fraction is not None and d.gap.before > d.gap.floor:
        between = f", 95 %: {percent(d.gap.interval[0])} to {percent(d.gap.interval[1])}" if d.gap.interval else ""
        numbers.append((percent(d.gap.explained_fraction), f"of the power beyond noise is explained{between}"))
    return numbers


def _where(d: Diagnosis) -> Section:
    """Shares by site, rod, axis, coordinate and region, as far as they exist."""
    where = d.where
    groups = (
        ("By site", {short(site_words(k)): v for k, v in where.site.items()}),
        ("By rod", where.rod),
        ("By axis", where.axis),
        (
            "By coordinate, the strongest correlation as 100 %",
            {short(coordinate_words(k)): v for k, v in where.covariate.items()},
        ),
    )
    beside = [(title, bars) for title, shares in groups if (bars := _bars(shares, 0.01))]
    if not beside or d.verdict == "none":
        return Section("where", "Where it lies", ["The residuals are noise: shares have no meaning."])
    content: list[Block] = [
        f"Computed before any cause is named. By {'rod, ' if where.rod else ''}axis and region: shares of the gap's mean "
        "square beyond noise. By site: shares of the largest gain in log evidence at each site, by an effect or a smooth term "
        "alone; common motions of several parts are left out. By covariate: the largest gain of a smooth term over it, "
        "relative to the best covariate.",
        Bars(beside=beside),
    ]
    if regions := _bars(_regions(where), 0.0)[:4]:
        content.append(Fold("By region of the workspace", [Bars(regions)]))
    return Section("where", "Where it lies", content)


def _bars(shares: Mapping[str, float], least: float) -> list[Bar]:
    """Bars of the shares above ``least``, the largest first."""
    top = max(shares.values(), default=0.0)
    order = sorted(shares.items(), key=lambda pair: -pair[1])
    return [Bar(name, share / top, percent(share)) for name, share in order if share >= least and share > 0.0]


def _regions(where: Where) -> dict[str, float]:
    """Shares by box of the workspace, in words."""
    return {
        ", ".join(whole(f"{a} {low:.2f} to {high:.2f}") for a, low, high in zip("xyz", *box, strict=True)) + " m": share
        for box, share in where.region
    }


def _causes(d: Diagnosis, by_cause: Mapping[tuple[str, str], Sequence[EffectCurve]]) -> Section:
    """Each cause with its parameters, what they mean, and its curves; then how a controller corrects them."""
    content: list[Block] = []
    given = ", given the other causes" if len(d.causes) > 1 else ""
    for k, c in enumerate(d.causes):
        effect, found = d.effect(c.effect), by_cause.get((c.effect, c.site), ())
        rows = [parameter(name, e.value, e.unit, e.sigma) for name, e in c.parameters.items()]
        explains = (
            f" It explains {percent(c.explained_fraction)} of the gap's power beyond noise{given}."
            if _estimable(d)
            else ""
        )
        told = sentence(clause(effect, c.site, d.model.robot))
        content += [
            Heading(named(effect, c.site), f"cause-{k + 1}"),
            f"{told} Its name in files and for --exclude: {c.effect}@{c.site}. Probability {chance(c.probability)}.{explains}",
            Table(("parameter", "value"), rows),
        ]
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


def _estimable(d: Diagnosis) -> bool:
    """Whether an explained fraction of the gap can be estimated."""
    return d.gap.before > d.gap.floor


def _explains(d: Diagnosis, cause: Cause) -> str:
    return percent(cause.explained_fraction) if _estimable(d) else "not estimable"


def _reach(d: Diagnosis, c: Cause, by_cause: Mapping[tuple[str, str], Sequence[EffectCurve]]) -> str:
    """The nonlinear parameter of a cause, such as a period, and its largest displacement, as text."""
    words = [reach(by_cause.get((c.effect, c.site), ()))]
    if d.effect(c.effect).has_nonlinear:  # it is the first of the parameters
        words.insert(0, size_words(c.parameters, 2))
    return "; ".join(filter(None, words))


def meaning(effect: Effect, robot: Robot) -> tuple[Markup, ...]:
    """Equation, signs and parameters of an effect at a robot, a paragraph each; empty without a docstring.

    Paragraphs on typical sizes are omitted, because the data have determined the size.
    """
    text = inspect.cleandoc(type(effect).__dict__.get("__doc__") or "")
    paragraphs = [" ".join(part.split()) for part in text.split("\n\n")]
    return tuple(_marked(part) for part in of_robot(paragraphs, robot) if part and not part.startswith("Typical size"))


def _marked(text: str) -> Markup:
    """A paragraph with its names set as code, and references to classes as the class name."""
    parts = re.sub(r":\w+:`~?(?:[\w.]+\.)?(\w+)`", r"``\1``", text).split("``")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 else escape(part) for i, part in enumerate(parts)
    )


def _left(d: Diagnosis, residuals: Residuals, views: Mapping[str, View], component: PlotChoice) -> Section:
    """What is left unexplained, and the coordinates with which it correlates, if it is more than noise."""
    left, p = percent(d.unexplained.share), _rare(d.unexplained.p_value)
    noise = d.unexplained.p_value >= CHANCE
    words = f"Nothing beyond noise: noise alone leaves as much with a probability of {p}."
    if not noise:
        words = (
            f"In units of the noise, all that was measured together, {left} of what geometry alone leaves beyond noise is not "
            "explained. (The gap above is in the measurements' own units, on poses that were not fitted.) Noise alone would "
            f"leave as much with a probability of {p}."
        )
    rows = [[site_words(site), coordinate_words(c), _rare(p)] for site, c, p in d.unexplained.correlates]
    content: list[Block] = [words]
    if rows and not (noise and d.verdict != "unknown"):
        content.append("Correlations of the residuals with smooth terms at every site:")
        content.append(Table(("site", "coordinates", "p-value under noise alone"), rows, (2,)))
        commands = d.unexplained.correlates[0][1].split(" ")[0].split(",")
        if len(commands) == 2 and all(name in commanded(residuals) for name in commands):
            content.append(Plots([over_two(residuals, commands[0], commands[1], views, component)]))
    return Section("left", "What is left", content)


def _rare(p_value: float) -> str:
    """A p-value as text; very small ones only as a bound."""
    return "less than 10⁻⁹" if p_value < 1e-9 else typeset(f"{p_value:.2g}")


def _evidence(d: Diagnosis) -> Section:
    """Gain in log evidence of geometry with each single candidate over geometry alone: bars and a table."""
    named = {(c.effect, c.site) for c in d.causes}
    tested = sorted((c for c in d.candidates if c.testable), key=lambda c: -c.log_evidence)
    top = max([c.log_evidence for c in tested], default=0.0)
    gains = [whole(f"{c.log_evidence:.1f}") for c in tested]
    bars = [
        Bar(_name(d, c), max(c.log_evidence, 0.0) / top if top > 0.0 else 0.0, gain, (c.effect, c.site) in named)
        for c, gain in zip(tested[:SHOWN], gains, strict=False)
    ]
    count = f"{len(tested)} candidate{'s' if len(tested) != 1 else ''}"
    content: list[Block] = [
        "Gain in log evidence of geometry with one candidate over geometry alone: a gain of 5 is a Bayes factor of 150, one of "
        f"10 of 22000. {count} were tested."
    ]
    if d.verdict == "unknown":
        content.append(
            "A large gain alone does not prove a cause: smooth terms without a name explain these data better, so a candidate "
            "may only resemble the true cause."
        )
    content.append(Bars(bars))
    if rest := [[_name(d, c), gain] for c, gain in list(zip(tested, gains, strict=True))[SHOWN:]]:
        table = Table(("candidate", "gain in log evidence"), rest, (1,))
        content.append(Fold("The other candidates", [table]))
    return Section("evidence", "Evidence", content)


def _name(d: Diagnosis, c: Considered | Member) -> str:
    return named(d.effect(c.effect), c.site)


def _other(d: Diagnosis, m: Member) -> str:
    """Another member of a class, with its size and probability."""
    size = size_words(m.parameters, 1 + d.effect(m.effect).has_nonlinear)
    return f"{', '.join(filter(None, (_name(d, m), size)))} ({chance(m.probability)})"


def _apart(d: Diagnosis) -> Section:
    """Classes of causes that can't be distinguished, and what to measure next."""
    content: list[Block] = []
    for c in d.causes:
        if len(c.members) > 1:
            content.append("These effects give nearly the same residuals in these data. Probabilities:")
            lead = (c.effect, c.site)
            content.append(
                Bars(
                    [
                        Bar(_name(d, m), m.probability, chance(m.probability), (m.effect, m.site) == lead)
                        for m in c.members
                    ]
                )
            )
    if not d.causes:
        content.append("No cause is named, so there are no alternatives to distinguish.")
    elif not content:
        content.append("Each cause is unique: no other effect of the catalogue explains these data as well.")
    if d.verdict == "explained":
        content.append(
            Note(
                [
                    "To confirm it: remove the cause on the machine, or load the corrections. Then measure as many poses of "
                    "the same kind again and diagnose them: only noise should remain."
                ]
            )
        )
    title = "What can't be told apart, and what to measure next"
    return Section("apart", title, [*content, *experiment_notes(d)], "What to measure next")


def _untestable(d: Diagnosis) -> Section:
    """Effects that could not be tested, with the reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for c in d.candidates:
        if not c.testable:
            reasons.setdefault((c.effect, reason_words(c.reason, c.site)), []).append(site_words(c.site))
    rows = [[d.effect(effect).title, joined(sites), reason] for (effect, reason), sites in reasons.items()]
    content: list[Block] = ["Every effect of the catalogue could be tested."]
    if rows:
        content = [
            "These data have no information on the following effects, for the reason given. A cause among them can't be named.",
            Table(("effect", "at", "why not"), rows),
        ]
    return Section("untestable", "What could not be tested", content, "Not testable")


def _parameters(d: Diagnosis) -> Section:
    moved, every = geometry_tables(d.baseline, d.model if d.causes else None)
    numbers = (1, 2, 3, 4, 5)
    arm = controller_blocks(d.model, doubt_of(d.verdict))
    content: list[Block] = [
        *([*arm, Heading("Placements")] if arm else []),
        "The geometric parameters with the largest deviations from nominal. Variance reduction: 1 − (sigma / tolerance)².",
        Table(moved.head, moved.rows, numbers),
        Fold(f"All {len(every.rows)} parameters of the geometry", [Table(every.head, every.rows, numbers)]),
    ]
    return Section("parameters", "Parameters", content)
