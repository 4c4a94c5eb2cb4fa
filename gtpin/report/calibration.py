"""A calibration as text, table, figures and files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from gtpin.calibration.checks.prepared import with_positions
from gtpin.calibration.observability import UNSEEN
from gtpin.calibration.result import Calibration
from gtpin.model.model_folder import write_model
from gtpin.output.json_text import json_text
from gtpin.output.shown import Presentation
from gtpin.report.ball_bar_plot import ball_bar_figure
from gtpin.report.calibration_page import calibration_page
from gtpin.report.calibration_text import calibration_summary, calibration_text
from gtpin.report.geometry_table import geometry_tables
from gtpin.report.maps import workspace_figure
from gtpin.report.quality import error_of
from gtpin.report.residual_plots import residual_figure
from gtpin.report.residuals import Residuals
from gtpin.report.unseen_words import unseen_words
from gtpin.report.words import quantity

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


CALIBRATION = ("calibration.json", "report.html", "report.txt", "model")
"""Names of the files of a calibration's folder."""


@dataclass(frozen=True)
class CalibrationPresentation(Presentation):
    """A calibration; its table is that of its parameters."""

    calibration: Calibration
    files = CALIBRATION

    def short(self) -> str:
        """Numbers of parameters and poses, the errors, and chi-square."""
        c = self.calibration
        sizes = [(error_of(b), quantity(b.before, b.unit), quantity(b.after, b.unit)) for b in c.by_instrument]
        errors = "\n".join(f"{what}, RMS: {before} nominal, {after} calibrated" for what, before, after in sizes)
        return (
            f"Calibration of {c.model.robot.name}: {len(c.names)} parameters from {c.poses} measurements\n"
            f"{errors}\n"
            f"chi-square per degree of freedom: {c.chi2_per_dof:.3f}"
        )

    def text(self) -> str:
        """The content of ``report.txt``."""
        return calibration_text(self.calibration)

    def terminal(self) -> str:
        """The fit, the noise, and the number of observable directions."""
        return calibration_summary(self.calibration)

    def table(self) -> pd.DataFrame:
        """A row for each parameter: ``value sigma low high unit nominal tolerance learned``, by its name."""
        c = self.calibration
        estimates = [c[name] for name in c.names]
        known = c.model.geometry.parameters
        return pd.DataFrame(
            {
                "value": [e.value for e in estimates],
                "sigma": [e.sigma for e in estimates],
                "low": [e.interval[0] for e in estimates],
                "high": [e.interval[1] for e in estimates],
                "unit": [e.unit for e in estimates],
                "nominal": [p.nominal for p in known],
                "tolerance": [p.tolerance for p in known],
                "learned": c.variance_reduction,
            },
            index=pd.Index(c.names, name="parameter"),
        )

    def residuals(self, against: str, component: str | None) -> Figure:
        """Residuals against a column."""
        residuals = Residuals.of(self.calibration.dataset, self.calibration)
        return residual_figure(residuals, against, component or residuals.first_component)

    def ball_bar(self, circle: int) -> Figure:
        """Deviations of the radius along a circle."""
        residuals = Residuals.of(
            with_positions(self.calibration.dataset, self.calibration.model.robot), self.calibration
        )
        return ball_bar_figure(residuals, circle, False)

    def workspace(self, view: str) -> Figure:
        """Position residuals, or errors of readings, over the workspace."""
        return workspace_figure(Residuals.of(self.calibration.dataset, self.calibration), view)

    def parameters(self) -> Figure:
        """The report's table of all parameters."""
        _, every = geometry_tables(self.calibration)
        return every.figure("Parameters of the geometry")

    def write(self, folder: Path) -> dict[str, object]:
        """Write ``model/``, ``calibration.json``, ``report.txt`` and ``report.html``; return the content of the JSON."""
        c, result = self.calibration, self.calibration.to_json()
        write_model(c.model, folder / "model")
        (folder / "calibration.json").write_text(json_text(result), encoding="utf-8")
        (folder / "report.txt").write_text(calibration_text(c), encoding="utf-8")
        (folder / "report.html").write_text(calibration_page(c, c.dataset), encoding="utf-8")
        return result

    def unseen(self) -> tuple[str, ...]:
        """A sentence for each direction that the data hardly show."""
        c = self.calibration
        unseen = c.observability.variance_reduction < UNSEEN
        directions, variance_reduction = (
            c.observability.directions[:, unseen],
            c.observability.variance_reduction[unseen],
        )
        return unseen_words(c.model.geometry, directions, variance_reduction, c.remedies)


present = CalibrationPresentation
