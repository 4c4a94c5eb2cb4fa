"""How a diagnosis is shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from rich.console import Console

from gtpin.diagnosis.result import Diagnosis
from gtpin.errors import GtpinError
from gtpin.output.shown import Presentation
from gtpin.report.ball_bar_plot import ball_bar_figure
from gtpin.report.curve_plots import curve_drawing, drawn_curves
from gtpin.report.diagnosis_json import diagnosis_json
from gtpin.report.diagnosis_text import diagnosis_summary
from gtpin.report.effect_curves import curves
from gtpin.report.figure import alone
from gtpin.report.files import DIAGNOSIS, write_diagnosis
from gtpin.report.gap_words import gap_words
from gtpin.report.maps import workspace_figure
from gtpin.report.page import Table
from gtpin.report.residual_columns import leading
from gtpin.report.residual_plots import residual_figure
from gtpin.report.residuals import Residuals
from gtpin.report.show.table_figure import table_figure
from gtpin.report.words import chance, percent, quantity

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

WIDTH = 120
"""Characters of a line of text."""
COLUMNS = ("effect", "site", "probability", "shrinkage", "parameter", "value", "sigma", "low", "high", "unit")
"""Columns of the table of causes."""


@dataclass(frozen=True)
class DiagnosisPresentation(Presentation):
    """A diagnosis; its table is that of its causes' parameters."""

    diagnosis: Diagnosis
    files = DIAGNOSIS

    def short(self) -> str:
        """Verdict, causes and the gap."""
        d = self.diagnosis
        lines = [f"Diagnosis of {d.model.robot.name}: {d.verdict}"]
        for cause in d.causes:
            name, first = next(iter(cause.parameters.items()))
            size = f"{name.replace('_', ' ')} {quantity(first.value, first.unit, first.sigma)}"
            lines.append(f"  {cause.effect} at {cause.site}, probability {chance(cause.probability)}, {size}")
        gap = d.gap
        words = gap_words(gap)
        after = f", {words.after} with the causes" if d.causes else ""
        lines.append(
            f"{words.what} on left-out poses, RMS: {words.before} by geometry alone{after}; noise {words.floor}"
        )
        return "\n".join(lines)

    def text(self) -> str:
        """What ``gtpin diagnose`` prints."""
        console = Console(highlight=False, markup=False, width=WIDTH, soft_wrap=True, color_system=None, record=False)
        with console.capture() as captured:
            console.print(diagnosis_summary(self.diagnosis))
        return "\n".join(line.rstrip() for line in captured.get().splitlines()) + "\n"

    def table(self) -> pd.DataFrame:
        """A row for each parameter of each cause."""
        rows = [
            (c.effect, c.site, c.probability, c.shrinkage, name, e.value, e.sigma, *e.interval, e.unit)
            for c in self.diagnosis.causes
            for name, e in c.parameters.items()
        ]
        return pd.DataFrame(rows, columns=list(COLUMNS))

    def residuals(self, against: str, component: str | None, *, after: bool) -> Figure:
        """Residuals against a column, with the causes' prediction."""
        residuals = _residuals(self.diagnosis)
        if component is None:
            component = leading(residuals, [c.site for c in self.diagnosis.causes], self.diagnosis.where.axis)
        return residual_figure(residuals, against, component, causes=bool(self.diagnosis.causes), after=after)

    def ball_bar(self, circle: int) -> Figure:
        """Deviations of the radius along a circle."""
        return ball_bar_figure(_residuals(self.diagnosis), circle, bool(self.diagnosis.causes))

    def workspace(self, view: str, *, after: bool) -> Figure:
        """Position residuals, or errors of readings, over the workspace."""
        return workspace_figure(_residuals(self.diagnosis), view, after=after)

    def effect(self, number: int, quantity: str | None) -> Figure:
        """The curve of a cause with its interval."""
        if not 0 <= number < len(self.diagnosis.causes):
            raise GtpinError(
                f"there is no cause {number}", hint=f"there are {len(self.diagnosis.causes)}, counted from 0"
            )
        cause = self.diagnosis.causes[number]
        active = next(e for e in self.diagnosis.model.effects if (e.effect.id, e.site) == (cause.effect, cause.site))
        found = curves(active, _residuals(self.diagnosis))
        chosen = (
            drawn_curves(found)[:1] if quantity is None else [curve for curve in found if curve.name == quantity][:1]
        )
        if not chosen:
            known = ", ".join(dict.fromkeys(curve.name for curve in found))
            raise GtpinError(f"{cause.effect} at {cause.site} has no curve of {quantity!r}", hint=f"it has {known}")
        made = curve_drawing(chosen[0]).figure()
        made.update_layout(yaxis_title=made.layout.title.text)
        return alone(made, f"{cause.effect} at {cause.site}, 95 % interval")

    def parameters(self) -> Figure:
        """The causes' parameters."""
        rows = [
            [c.effect, c.site, chance(c.probability), name.replace("_", " "), quantity(e.value, e.unit, e.sigma)]
            + [quantity(end, e.unit) for end in e.interval]
            + [percent(c.shrinkage)]
            for c in self.diagnosis.causes
            for name, e in c.parameters.items()
        ]
        head = ("effect", "site", "probability", "parameter", "value", "95 % from", "to", "takes away")
        return table_figure(Table(head, rows), "Parameters of the causes")

    def write(self, folder: Path) -> None:
        """Write the files of ``gtpin diagnose``."""
        write_diagnosis(self.diagnosis, folder)

    def json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        return diagnosis_json(self.diagnosis)


def _residuals(d: Diagnosis) -> Residuals:
    return Residuals.of(d.dataset, d.baseline, d.model, d.set_aside_rows)


present = DiagnosisPresentation
