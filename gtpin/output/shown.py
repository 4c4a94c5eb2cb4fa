"""Display of results: in a Python session, in a notebook, as text and as a table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from gtpin.extensions import extension, extension_names
from gtpin.output.results import results_folder

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import RenderableType

ROWS = 12
"""Rows of a table that a notebook shows; ``to_dataframe`` has all."""


class Presentation(ABC):
    """The display of a result; ``gtpin/report`` has one for each kind of result."""

    @abstractmethod
    def short(self) -> str:
        """The result in a few lines."""

    @abstractmethod
    def text(self) -> str:
        """The whole result as text."""

    def terminal(self, folder: Path | None = None) -> RenderableType:
        """What the result's command prints, by default the whole text; ``folder``: where the result is written."""
        return self.text().rstrip("\n")

    @abstractmethod
    def table(self) -> pd.DataFrame:
        """The result as a table."""

    def html(self) -> str:
        """The few lines and the first rows of the table, as HTML."""
        first, *others = (escape(line) for line in self.short().splitlines())
        lines = "<br>".join([f"<b>{first}</b>", *others])
        table = self.table()
        return f"<p>{lines}</p>{table.to_html(max_rows=ROWS) if len(table) else ''}"


class SavedPresentation(Presentation):
    """The display of a result that can be saved; ``files``: names of what :meth:`write` writes into a folder."""

    files: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def write(self, folder: Path) -> dict[str, object]:
        """Write the result into a new folder; return what the command prints with ``--json``."""

    def save(self, folder: Path, *, force: bool) -> None:
        """Write the files of the result's command into a folder: see :func:`~gtpin.output.results.results_folder`."""
        with results_folder(folder, self.files, force=force) as new:
            self.write(new)


PRESENTATIONS = {
    "Accuracy": "gtpin.report.accuracy",
    "Calibration": "gtpin.report.calibration",
    "Comparison": "gtpin.report.comparison",
    "Dataset": "gtpin.report.dataset",
    "Diagnosis": "gtpin.report.diagnosis",
    "Experiment": "gtpin.report.next_experiment",
    "HealthCheck": "gtpin.report.health",
    "PosePlan": "gtpin.report.plan",
    "Poses": "gtpin.report.dataset",
}
"""For each kind of result the module with its class ``...Presentation``. Those of extras are registered by entry
points of the group ``gtpin.presentations``, under the name of the result."""
GROUP = "gtpin.presentations"


def present(result: object) -> Any:
    """The presentation of a result: its text, table, figures, files, and sentences.

    This is the only way from results to the report. The report is imported here, when a result is first shown, so that results
    do not depend on it.
    """
    kinds = [kind.__name__ for kind in type(result).__mro__]
    for name in kinds:
        if name in PRESENTATIONS:
            return getattr(import_module(PRESENTATIONS[name]), f"{name}Presentation")(result)
    return extension(GROUP, next((name for name in kinds if name in extension_names(GROUP)), kinds[0]))(result)


class Shown:
    """A result with a display as text, table and HTML."""

    def __repr__(self) -> str:
        return str(present(self).short())

    def _repr_html_(self) -> str:
        return str(present(self).html())

    def summary(self) -> str:
        """The whole result as text."""
        return str(present(self).text())

    def to_dataframe(self) -> pd.DataFrame:
        """The result as a table; ``docs/python.md`` explains its columns."""
        table: pd.DataFrame = present(self).table()
        return table
