"""How an accuracy analysis is shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from gtpin.accuracy.analysis import Accuracy
from gtpin.accuracy.figures import FILES, write_accuracy
from gtpin.output.shown import Presentation
from gtpin.report.accuracy_text import accuracy_text
from gtpin.report.sensitivity_page import sensitivity_page, step_table
from gtpin.report.show.table_figure import table_figure
from gtpin.report.workspace_maps import workspace_map

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True)
class AccuracyPresentation(Presentation):
    """An accuracy analysis; its table is that of the sensitivity."""

    accuracy: Accuracy
    files = (*FILES, "report.html")

    def short(self) -> str:
        """The expected errors."""
        return accuracy_text(self.accuracy)

    def text(self) -> str:
        """The expected errors, and the sensitivity to each parameter."""
        return f"{self.short()}\n\n{self.table().to_string(index=False)}\n"

    def table(self) -> pd.DataFrame:
        """The columns of sensitivity.csv."""
        return self.accuracy.sensitivity.to_table()

    def write(self, folder: Path) -> None:
        """Write the files of ``gtpin sensitivity``."""
        write_accuracy(self.accuracy, folder)
        (folder / "report.html").write_text(sensitivity_page(self.accuracy, seed=self.accuracy.seed), encoding="utf-8")

    def parameters(self) -> Figure:
        """The report's table of steps."""
        title = f"Mean change of the TCP's position, µm, by a step of {self.accuracy.sensitivity.step:g}"
        return table_figure(step_table(self.accuracy), title)

    def workspace(self, quantity: str) -> Figure:
        """Slices of the workspace, coloured by a quantity."""
        return workspace_map(self.accuracy, quantity)


present = AccuracyPresentation
