"""A comparison of the paper's models as text, table, figures and page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group, RenderableType

from gtpin.comparison.compare import Comparison
from gtpin.data import CartMeasurements
from gtpin.errors import DatasetError
from gtpin.model.measured_robot import robot_of
from gtpin.output.figure import new_figure, write_figures
from gtpin.output.results import json_text
from gtpin.report.figure import ACCENT, FIT, GOOD, INK, SOFT, WARN, Drawing, Plot, PlotChoice, alone, scatter, titled
from gtpin.report.page import Lead, PagePresentation, Plots, Section, Step, Table, in_terminal, provenance
from gtpin.report.residual_plots import shown
from gtpin.report.words import whole

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as Picture
    from plotly.graph_objects import Figure

MODELS = {
    1: "reduced arm, straight tracks",
    2: "reduced arm, measured tracks",
    3: "full arm, straight tracks",
    4: "full arm, measured tracks",
    5: "full arm, each link on the track that suits it",
}
COLORS = {1: SOFT, 2: WARN, 3: ACCENT, 4: GOOD, 5: FIT}
FIGURES = {"mean_um": "mean", "rms_um": "root mean square", "max_um": "largest"}
ANGLES = PlotChoice("angle", "Angle", (("alpha", "alpha"), ("beta", "beta"), ("gamma", "gamma")))
"""ZYZ Euler angles."""


@dataclass(frozen=True)
class ComparisonPresentation(PagePresentation):
    """A comparison; its table has a row for each model."""

    comparison: Comparison
    files = ("compare.csv", "compare.json", "position_errors.png", "report.html")

    @cached_property
    def lead(self) -> Lead:
        """The model that predicts best."""
        c = self.comparison
        best = min(c.held, key=lambda held: float(held.position.mean())).model
        command = f"gtpin calibrate DATASET -o calibrated --model {best}"
        step = Step(f"To identify model {best} from all poses:", command)
        eyebrow = f"Models 1 to 5 of Dressler et al. 2010 · {len(c.held[0].position)} held-out poses"
        tab = f"Models of {robot_of(c.dataset).name} compared"
        return Lead(eyebrow, *_verdict(c), steps=[step], warnings=c.warnings, tab=tab)

    @cached_property
    def sections(self) -> Sequence[Section]:
        """Errors, angles and tracks, as far as they were measured."""
        c, carts = self.comparison, self.comparison.dataset.carts
        sections = [_errors(c)]
        if any(held.angles is not None for held in c.held):
            plot = Plot("angles", "Orientation errors pose by pose", partial(angles_drawing, c), (ANGLES,))
            words = "Measured less predicted ZYZ Euler angles."
            sections.append(Section("angles", "Orientation errors", [Plots([plot], words, [ANGLES])]))
        if carts is not None:
            title = "What a straight line leaves of each cart's measured track"
            plot = Plot("carts", title, partial(carts_drawing, carts), height=320)
            words = "Residuals of a linear fit to each cart's measured positions."
            sections.append(Section("carts", "The carts' tracks", [words, Plots([plot])]))
        return sections

    @property
    def origin(self) -> Table:
        """Versions, seed and digests."""
        c = self.comparison
        return provenance(c.dataset, robot_of(c.dataset), c.seed)

    def terminal(self, folder: Path | None = None) -> RenderableType:
        """The first screen, and the errors of each model."""
        return Group(super().terminal(folder), *in_terminal(_errors(self.comparison).content))

    def table(self) -> pd.DataFrame:
        """The columns of compare.csv."""
        return self.comparison.table()

    def write(self, folder: Path) -> dict[str, object]:
        """Write the files of ``gtpin compare`` (without matplotlib: no picture); return the content of the JSON."""
        content = self.comparison.to_json()
        self.table().to_csv(folder / "compare.csv", index=False, lineterminator="\n")
        (folder / "compare.json").write_text(json_text(content), encoding="utf-8")
        (folder / "report.html").write_text(self.page(), encoding="utf-8")
        write_figures(lambda: {"position_errors": position_errors(self.comparison)}, folder)
        return content

    def errors(self) -> Figure:
        """Position errors of each model."""
        return alone(errors_drawing(self.comparison), "Position errors on held-out poses, 95 % intervals")

    def angles(self, angle: str) -> Figure:
        """Errors of an Euler angle."""
        return alone(angles_drawing(self.comparison, angle), f"Errors of the Euler angle {angle} on held-out poses")


def _errors(c: Comparison) -> Section:
    head = ["model", "what it is", "mean (µm)", "95 %", "rms (µm)", "largest (µm)", "orientation, rms (mrad)", "poses"]
    rows = []
    for held, ends in zip(c.held, c.intervals(), strict=True):
        f, (low, high) = held.figures(), ends["mean_um"] or (np.nan, np.nan)
        mean, rms, most = (f"{f[name]:.0f}" for name in FIGURES)
        turned = "" if f["orientation_rms_mrad"] is None else f"{f['orientation_rms_mrad']:.3f}"
        about = [str(held.model), MODELS[held.model], mean, whole(f"{low:.0f} to {high:.0f}")]
        rows.append([*about, rms, most, turned, str(len(held.position))])
    how = (
        "Each model was fitted to one half of the poses and tested on the other, in both directions "
        "(pose residuals, tolerances as priors). Intervals: 95 %, by resampling poses."
    )
    plot = Plot("errors", "Position errors of each model with 95 % intervals", partial(errors_drawing, c), height=360)
    return Section("errors", "Errors", [how, Plots([plot]), Table(head, rows, range(2, 8))])


def _verdict(c: Comparison) -> tuple[str, list[str]]:
    intervals = {held.model: ends["mean_um"] for held, ends in zip(c.held, c.intervals(), strict=True)}
    means = {held.model: float(held.position.mean() * 1e6) for held in c.held}
    best, *others = sorted(means, key=means.__getitem__)
    words = f"Model {best} ({MODELS[best]}) predicts best"
    lacking = "Models 2, 4 and 5 need the carts' tracks in carts.csv."
    if not others:
        return f"{words}: it is the only one that these data allow.", [lacking]
    top, low = intervals[best], intervals[others[0]]
    advice = [] if len(means) == len(MODELS) else [lacking]
    if top is None or low is None or top[1] >= low[0]:
        advice.insert(0, "Their intervals overlap: these data don't settle which of the two is better.")
    one, two = (whole(f"{means[model]:.0f} µm") for model in (best, others[0]))
    return f"{words}: {one} mean error on held-out poses, against {two} of model {others[0]}.", advice


def errors_drawing(comparison: Comparison) -> Drawing:
    """Mean, root mean square and largest position error of each model on held-out poses, with 95 % intervals."""
    traces = []
    for held, ends in zip(comparison.held, comparison.intervals(), strict=True):
        figures = held.figures()
        values = np.array([figures[name] for name in FIGURES], dtype=float)
        between = np.array([ends[name] for name in FIGURES], dtype=float)
        # A resampled maximum never exceeds the measured one, and a figure need not be inside its interval.
        bars = {"type": "data", "symmetric": False, "array": np.maximum(between[:, 1] - values, 0.0)}
        bars |= {"arrayminus": np.maximum(values - between[:, 0], 0.0), "color": INK, "thickness": 1.2}
        trace = {"type": "bar", "name": f"model {held.model}", "x": list(FIGURES.values()), "y": values}
        traces.append(trace | {"error_y": bars, "marker": {"color": COLORS[held.model]}})
    yaxis = {"title": {"text": "position error (µm)"}, "rangemode": "tozero"}
    return Drawing(traces, {"barmode": "group", "yaxis": yaxis})


def position_errors(comparison: Comparison) -> Picture:
    """The drawing of the position errors as a picture.

    Raises `GtpinError` if matplotlib is not there.
    """
    picture, traces = new_figure(9.0, 3.8), errors_drawing(comparison).traces
    axes, places, width = picture.subplots(), np.arange(len(FIGURES)), 0.8 / len(traces)
    for i, trace in enumerate(traces):
        look = {"color": trace["marker"]["color"], "label": trace["name"], "capsize": 4}
        bars = [trace["error_y"][side] for side in ("arrayminus", "array")]
        axes.bar(places + width * i, trace["y"], width, yerr=bars, **look)
    axes.set_xticks(places + width * (len(traces) - 1) / 2.0, list(FIGURES.values()))
    axes.set_ylabel("position error (µm)")
    axes.legend()
    picture.suptitle(f"Errors on {len(comparison.held[0].position)} held-out poses, 95 % intervals")
    return picture


def angles_drawing(comparison: Comparison, angle: str = "alpha") -> Drawing:
    """An Euler angle (ZYZ), measured less predicted, of each held-out pose.

    Raises `DatasetError` if orientation was not measured, or there is no such angle.
    """
    names = [name for name, _ in ANGLES.options]
    turned = [(held.model, held.angles) for held in comparison.held if held.angles is not None]
    if not turned:
        raise DatasetError("orientation was not measured", hint="give qw qx qy qz")
    if angle not in names:
        raise DatasetError(f"there is no angle {angle!r}", hint=f"give one of {', '.join(names)}")
    traces = []
    for model, angles in turned:
        rows, look = shown(len(angles)), {"width": 1.2, "color": COLORS[model]}
        y = 1e3 * angles[rows, names.index(angle)]
        traces.append(scatter("lines", rows, y, name=f"model {model}", line=look))
    return Drawing(traces, titled("held-out pose, in the dataset's order", f"{angle} (mrad)"))


def carts_drawing(carts: CartMeasurements) -> Drawing:
    """Residuals of a straight line fitted to each cart's measured positions."""
    traces = []
    for j in range(carts.n_actuators):
        rows = np.flatnonzero(carts.cart == j + 1)
        rows = rows[np.argsort(carts.q[rows], kind="stable")]
        q, position = carts.q[rows], carts.position[rows]
        slope, start = np.polyfit(q, position, 1)
        off, some = np.linalg.norm(position - start - np.outer(q, slope), axis=1), shown(len(q))
        traces.append(scatter("lines", q[some], 1e6 * off[some], name=f"cart {j + 1}"))
    layout = titled("commanded position (m)", "off a straight line (µm)")
    layout["yaxis"]["rangemode"] = "tozero"
    return Drawing(traces, layout)
