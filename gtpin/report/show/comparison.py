"""How a comparison of the paper's models is shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from gtpin.comparison.figures import FILES, write_comparison
from gtpin.comparison.result import Comparison
from gtpin.errors import GtpinError
from gtpin.model.measured_robot import robot_of
from gtpin.output.shown import Presentation
from gtpin.report.comparison_page import comparison_page
from gtpin.report.comparison_plots import angles_drawing, errors_drawing
from gtpin.report.comparison_text import comparison_text
from gtpin.report.figure import alone

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True)
class ComparisonPresentation(Presentation):
    """A comparison; its table has a row for each model."""

    comparison: Comparison
    files = (*FILES, "report.html")

    def short(self) -> str:
        """The models with their mean errors, and the number of poses."""
        c = self.comparison
        models = ", ".join(f"{held.model} ({1e6 * held.position.mean():.0f} µm)" for held in c.held)
        return f"Comparison of models on {len(c.held[0].position)} held-out poses\nmean position error: {models}"

    def text(self) -> str:
        """What ``gtpin compare`` prints."""
        return comparison_text(self.comparison) + "\n"

    def table(self) -> pd.DataFrame:
        """The columns of compare.csv."""
        return self.comparison.table()

    def write(self, folder: Path) -> None:
        """Write the files of ``gtpin compare``."""
        data = self.comparison.dataset
        if data is None:
            raise GtpinError("the comparison has no data to write", hint="give Comparison its dataset")
        write_comparison(self.comparison, folder, carts=data.carts)
        page = comparison_page(self.comparison, data, robot_of(data))
        (folder / "report.html").write_text(page, encoding="utf-8")

    def errors(self) -> Figure:
        """Position errors of each model."""
        return alone(errors_drawing(self.comparison).figure(), "Position errors on held-out poses, 95 % intervals")

    def angles(self, angle: str) -> Figure:
        """Errors of an Euler angle."""
        return alone(
            angles_drawing(self.comparison, angle).figure(), f"Errors of the Euler angle {angle} on held-out poses"
        )


present = ComparisonPresentation
