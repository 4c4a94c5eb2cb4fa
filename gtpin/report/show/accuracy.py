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

    def write(self, folder: Path) -> dict[str, object]:
        """Write the files of ``gtpin sensitivity``; return the content of the JSON."""
        write_accuracy(self.accuracy, folder)
        (folder / "report.html").write_text(sensitivity_page(self.accuracy, seed=self.accuracy.seed), encoding="utf-8")
        return self.accuracy.to_json()

    def parameters(self) -> Figure:
        """The report's table of steps."""
        title = f"Mean change of the TCP's position, µm, by a step of {self.accuracy.sensitivity.step:g}"
        return step_table(self.accuracy).figure(title)

    def workspace(self, quantity: str) -> Figure:
        """Slices of the workspace, coloured by a quantity."""
        return workspace_map(self.accuracy, quantity)


present = AccuracyPresentation
