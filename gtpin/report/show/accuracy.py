"""How an accuracy analysis is shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from gtpin.accuracy.analysis import Accuracy
from gtpin.accuracy.files import FILES, write_accuracy
from gtpin.output.results import results_folder
from gtpin.output.shown import Presentation
from gtpin.report.accuracy_text import accuracy_text
from gtpin.report.sensitivity_page import sensitivity_page, step_table
from gtpin.report.show.table_figure import table_figure

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True)
class AccuracyPresentation(Presentation):
    """An accuracy analysis; its table is that of the sensitivity."""

    accuracy: Accuracy

    def short(self) -> str:
        """The expected errors."""
        return accuracy_text(self.accuracy)

    def text(self) -> str:
        """The expected errors, and the sensitivity to each parameter."""
        return f"{self.short()}\n\n{self.table().to_string(index=False)}\n"

    def table(self) -> pd.DataFrame:
        """The columns of sensitivity.csv."""
        return self.accuracy.sensitivity.to_table()


def save(found: Accuracy, folder: Path, *, force: bool) -> None:
    """Write the files that ``gtpin sensitivity`` writes."""
    with results_folder(folder, (*FILES, "report.html"), force=force) as new:
        write_accuracy(found, new)
        (new / "report.html").write_text(sensitivity_page(found, seed=found.seed), encoding="utf-8")


def parameter_table(found: Accuracy) -> Figure:
    """The report's table of steps."""
    title = f"Mean change of the TCP's position, µm, by a step of {found.sensitivity.step:g}"
    return table_figure(step_table(found), title)
