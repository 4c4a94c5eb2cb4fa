"""A diagnosis as text, terminal text, table, figures, page, JSON and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup
from rich.console import Console, Group, RenderableType

from gtpin.diagnosis.result import Cause, Diagnosis, HealthCheck
from gtpin.errors import GtpinError
from gtpin.model.model import Model
from gtpin.model.model_folder import write_model
from gtpin.output.results import json_text
from gtpin.report.calibration_text import nominal_words
from gtpin.report.diagnosis_json import diagnosis_json
from gtpin.report.effect_curves import EffectCurve, curve_drawing, drawn_curves, reach
from gtpin.report.figure import alone
from gtpin.report.next_experiment import FOLDER, write_experiments
from gtpin.report.page import Lead, Table, report
from gtpin.report.phrases import (
    cause_rows,
    interval,
    named,
    others,
    overlap,
    parameter,
    size_words,
    sized,
    value,
)
from gtpin.report.provenance import provenance
from gtpin.report.sections import FitPresentation, Reported, sections
from gtpin.report.sketch import drawing
from gtpin.report.verdict import (
    also,
    assumed,
    beyond_noise,
    could_be,
    gap_words,
    may_hide,
    missing_columns,
    not_recorded,
    questions,
    verdict,
)
from gtpin.report.words import capital, chance, percent, quantity, site_words
from gtpin.threads import in_one_thread

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure

DIAGNOSIS = ("baseline", "model", "diagnosis.json", "report.html", FOLDER)
"""Names of the files of a diagnosis's folder."""
WIDTH = 120
"""Characters of a line of text."""
COLUMNS = ("effect", "site", "probability", "shrinkage", "parameter", "value", "sigma", "low", "high", "unit")
"""Columns of the table of causes."""


@dataclass(frozen=True)
class DiagnosisPresentation(FitPresentation):
    """A diagnosis; its table is that of its causes' parameters."""

    diagnosis: Diagnosis
    files = DIAGNOSIS

    def short(self) -> str:
        """Verdict, causes and the gap."""
        d, size = self.diagnosis, gap_words(self.diagnosis.gap)
        lines = [f"Diagnosis of {d.model.robot.name}: {d.verdict}"]
        for cause in d.causes:
            first, name = value(*next(iter(cause.parameters.items()))), named(d.effect(cause.effect), cause.site)
            lines.append(f"  {name}, probability {chance(cause.probability)}, {first}")
        after = f", {size.after} with the causes" if d.causes else ""
        lines.append(f"{size.what} on left-out poses, RMS: {size.before} by geometry alone{after}; noise {size.floor}")
        return "\n".join(lines)

    def text(self) -> str:
        """What ``gtpin diagnose`` prints."""
        console = Console(highlight=False, markup=False, width=WIDTH, soft_wrap=True, color_system=None)
        with console.capture() as captured:
            console.print(self.terminal())
        return "\n".join(line.rstrip() for line in captured.get().splitlines()) + "\n"

    def terminal(self) -> RenderableType:
        """Verdict, causes with class and probability, and the gap before and after."""
        d = self.diagnosis
        parts: list[RenderableType] = [verdict(d).headline]
        if d.causes:
            parts.append(Table(("cause", "probability", "parameters", "of the gap"), cause_rows(d), (1, 3)).printed())
        parts += [*not_recorded(d), *could_be(d), *may_hide(d), *also(d), *questions(d), *self._gap(), *assumed(d)]
        if count := sum(not candidate.testable for candidate in d.candidates):
            many = f"{count} of {len(d.candidates)} candidates"
            parts.append(f"{many} can't be tested with these data{missing_columns(d)}; the report gives the reasons.")
        return Group(*parts)

    def _gap(self) -> list[str]:
        gap, size = self.diagnosis.gap, gap_words(self.diagnosis.gap)
        what = f"{capital(size.what)} on left-out {'sessions' if gap.hold_out == 'session' else 'poses'}, RMS"
        if not self.diagnosis.causes:
            taken = self.diagnosis.noise_source == "residuals"
            floor = f"{size.floor} is taken as noise" if taken else f"noise is {size.floor}"
            return [f"{what}: {size.before}, of which {floor}."]
        lines = [f"{what}: {size.before} by geometry alone -> {size.after} with the causes; noise alone {size.floor}."]
        if gap.explained_fraction is not None and gap.interval is not None:
            share, low, high = map(percent, (gap.explained_fraction, *gap.interval))
            lines.append(f"Explained fraction of the gap's power beyond noise: {share} (95 %: {low} to {high}).")
        return [*lines, *filter(None, (beyond_noise(gap), overlap(self.diagnosis)))]

    def table(self) -> pd.DataFrame:
        """A row for each parameter of each cause."""
        import pandas as pd

        rows = [
            (c.effect, c.site, c.probability, c.explained_fraction, name, e.value, e.sigma, *e.interval, e.unit)
            for c in self.diagnosis.causes
            for name, e in c.parameters.items()
        ]
        return pd.DataFrame(rows, columns=list(COLUMNS))

    @cached_property
    def reported(self) -> Reported:
        """What page and figures are made from."""
        return Reported(self.diagnosis.baseline, self.diagnosis)

    def effect(self, number: int, name: str | None) -> Figure:
        """The curve of a cause with its interval."""
        causes = self.diagnosis.causes
        if not 0 <= number < len(causes):
            raise GtpinError(f"there is no cause {number}", hint=f"there are {len(causes)}, counted from 0")
        cause = causes[number]
        found = self.reported.curves[cause.effect, cause.site]
        chosen = drawn_curves(found) if name is None else [curve for curve in found if curve.name == name]
        if not chosen:
            known = ", ".join(dict.fromkeys(curve.name for curve in found))
            raise GtpinError(f"{cause.effect} at {cause.site} has no curve of {name!r}", hint=f"it has {known}")
        drawing = curve_drawing(chosen[0])
        title = f"{named(self.diagnosis.effect(cause.effect), cause.site)}, 95 % interval"
        return alone(drawing, title, yaxis={"title": {"text": drawing.layout["title"]["text"]}})

    def parameters(self) -> Figure:
        """The causes' parameters."""
        rows = []
        for c in self.diagnosis.causes:
            about = (self.diagnosis.effect(c.effect).title, site_words(c.site), chance(c.probability))
            for name, e in c.parameters.items():
                size = (*parameter(name, e.value, e.unit, e.sigma), *interval(name, e))
                rows.append([*about, *size, percent(c.explained_fraction)])
        head = ("cause", "at", "probability", "parameter", "value", "95 % from", "to", "takes away")
        return Table(head, rows).figure("Parameters of the causes")

    @in_one_thread
    def write(self, folder: Path) -> dict[str, object]:
        """Write ``baseline/``, ``model/``, ``diagnosis.json``, ``report.html`` and the next experiments' commands.

        Returns the content of ``diagnosis.json``.
        """
        d = self.diagnosis
        return write_findings(d, d.baseline.model, self.json(), diagnosis_page(d), folder)

    def json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        return diagnosis_json(self.diagnosis)


def write_findings(
    found: Diagnosis | HealthCheck, baseline: Model, result: dict[str, Any], page: str, folder: Path
) -> dict[str, Any]:
    """Write the files of a diagnosis or a check into a folder; returns the content of ``diagnosis.json``."""
    write_model(baseline, folder / "baseline")
    write_model(found.model, folder / "model")
    (folder / "diagnosis.json").write_text(json_text(result), encoding="utf-8")
    write_experiments(found, folder)
    (folder / "report.html").write_text(page, encoding="utf-8")
    return result


def diagnosis_page(d: Diagnosis) -> str:
    """The whole report of a diagnosis as one self-contained HTML file: the verdict first, then the evidence for it."""
    robot, reported = d.baseline.model.robot, Reported(d.baseline, d)
    origin = provenance(reported.dataset, robot, d.seed)
    return report(f"{robot.name}: {d.verdict}", _lead(d, reported), sections(reported), origin)


def _lead(d: Diagnosis, reported: Reported) -> Lead:
    shares = () if d.verdict == "none" else (d.where.site, d.where.rod, [c.site for c in d.causes])
    caption = "No part of the machine stands out."
    if shares:
        caption = (
            "Redder: a motion of this part alone would explain more of the gap. One scale for all parts; shares from 5 % are "
            f"shown.{' Ringed or edged in blue: the sites of the causes.' if d.causes else ''}"
        )
    rows = [_cause_row(d, k, cause, reported.curves) for k, cause in enumerate(d.causes)]
    head = ("cause", "at", "probability", "explains of the gap", "size", "could also be")
    return replace(
        verdict(d),
        numbers=_numbers(d),
        sketch=drawing(d.model, d.dataset.q.mean(axis=0), *shares),
        caption=caption,
        content=[Table(head, rows, (2, 3), wide=(4, 5))] if rows else [],
    )


def _cause_row(
    d: Diagnosis, k: int, cause: Cause, by_cause: Mapping[tuple[str, str], Sequence[EffectCurve]]
) -> list[str]:
    """A cause with its largest displacement, its nonlinear parameter, such as a period, and the others of its class."""
    effect = d.effect(cause.effect)
    also = [f"{sized(d, m, named(d.effect(m.effect), m.site))} ({chance(m.probability)})" for m in others(cause)]
    sizes = [size_words(cause.parameters, 2)] if effect.has_nonlinear else []  # it is the first of the parameters
    sizes.append(reach(by_cause.get((cause.effect, cause.site), ())))
    return [
        Markup('<a href="#cause-{}">{}</a>').format(k + 1, effect.title),
        site_words(cause.site),
        chance(cause.probability),
        percent(cause.explained_fraction) if d.gap.before > d.gap.floor else "not estimable",
        "; ".join(filter(None, sizes)),
        "; ".join(also) or "nothing else",
    ]


def _numbers(d: Diagnosis) -> list[tuple[str, str]]:
    numbers, size, unexplained = list[tuple[str, str]](), gap_words(d.gap), d.baseline.model.unexplained
    if len(d.gap.by_instrument) > 1:
        for one in d.gap.by_instrument:
            before, after, floor = (quantity(value, one.unit) for value in (one.before, one.after, one.floor))
            words = f"{one.name}, gap of the calibrated geometry{', and with the causes' if d.causes else ''}"
            numbers.append((f"{before} → {after}" if d.causes else before, f"{words}; noise alone {floor}"))
    else:
        known = unexplained is None or unexplained.noise_known
        numbers += [
            (nominal_words(d.baseline), "nominal geometry, RMS"),
            (size.before, "calibrated geometry, at left-out poses"),
            *([(size.after, "with the causes")] if d.causes else []),
            (size.floor, "noise alone" if known else "left of the fit: the noise is not known"),
        ]
    if d.gap.explained_fraction is not None and d.gap.before > d.gap.floor:
        between = f", 95 %: {percent(d.gap.interval[0])} to {percent(d.gap.interval[1])}" if d.gap.interval else ""
        numbers.append((percent(d.gap.explained_fraction), f"of the power beyond noise is explained{between}"))
    return numbers
