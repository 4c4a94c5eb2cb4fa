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
    from plotly.graph_objects import Figure
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


class SavedResult(Shown):
    """A result with a command that writes it into a folder: ``gtpin calibrate``, ``gtpin diagnose``, ``gtpin compare``, ..."""

    def save(self, folder: Path | str, *, force: bool = False) -> None:
        """Write the files that the command writes: a JSON file, models or tables, and a page.

        With ``force``, files of these names that gtpin has not written are renamed (``NAME.old-1``).
        """
        shown = present(self)
        with results_folder(Path(folder), shown.files, force=force) as new:
            shown.write(new)


class FitResult(SavedResult):
    """A calibration or a diagnosis: a result with residuals.

    Where a method has ``after``: True for the residuals of the geometry with the causes, False for those of the geometry alone.
    A calibration has no causes: both are the same.
    """

    def plot_residuals(self, against: str, component: str | None = None, *, after: bool = False) -> Figure:
        """Plot a component of the residuals against a command or covariate, with the prediction by the causes.

        Parameters
        ----------
        against
            The column: ``q1``, ``time``, ...
        component
            An axis of the pose (``x``, ``y``, ``z``, ``rx``, ``ry``, ``rz``), or the site of an actuator for the error of its
            travel. By default the first cause's site that is an actuator, else the axis with the largest share of the gap; of
            a calibration the first actuator. For a dataset of schema 2 a component of its readings takes the place of the
            axis: its name (``range``) where there is one instrument; where there are several, the instrument's name
            (``wire``), followed by the component if it reads more than one (``cup.x``). The default is then the component of
            which the causes explain most, of a calibration the first.
        after
            Which residuals.

        Raises
        ------
        DatasetError
            If there is no such column or component.
        """
        figure: Figure = present(self).against(against, component, after=after)
        return figure

    def plot_workspace(self, view: str = "xy", *, after: bool = False) -> Figure:
        """Plot the position residuals in a plane of the base frame: ``xy``, ``xz`` or ``yz``.

        For a dataset of schema 2: the size of each reading's residual over its sigma.
        """
        figure: Figure = present(self).workspace(view, after=after)
        return figure

    def plot_ball_bar(self, circle: int = 0) -> Figure:
        """Polar plots of a circular test: deviations of the radius as measured, and those that geometry and causes leave.

        The dataset needs a ``range`` instrument with readings along half a turn or more about a station, as a ball bar gives.

        Parameters
        ----------
        circle
            Index of the circle, counted from 0, where the dataset has several.

        Raises
        ------
        DatasetError
            If there is no such circle.
        """
        figure: Figure = present(self).ball_bar(circle)
        return figure

    def plot_parameters(self) -> Figure:
        """The table of the parameters, of the geometry or of the causes, as a figure."""
        figure: Figure = present(self).parameters()
        return figure
