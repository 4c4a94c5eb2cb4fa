"""The page of a comparison of the paper's models on held-out poses."""

from __future__ import annotations

from typing import Any

import numpy as np

from gtpin.calibration.cart_tracks import Linearity
from gtpin.comparison.result import Comparison
from gtpin.data import CartMeasurements, Dataset
from gtpin.report.page import Plot, Table, render
from gtpin.report.provenance import provenance
from gtpin.report.residual_plots import shown
from gtpin.report.words import whole
from gtpin.robot.robot import Robot

CONTENTS = (("errors", "Errors"), ("angles", "Orientation errors"), ("provenance", "Provenance"))
MODELS = {
    1: "reduced arm, straight tracks",
    2: "reduced arm, measured tracks",
    3: "full arm, straight tracks",
    4: "full arm, measured tracks",
    5: "full arm, each link on the track that suits it",
}
COLORS = {1: "@soft", 2: "@warn", 3: "@accent", 4: "@good", 5: "@fit"}
FIGURES = {"mean_um": "mean", "rms_um": "root mean square", "max_um": "largest"}


def comparison_page(comparison: Comparison, dataset: Dataset, robot: Robot) -> str:
    """The whole report of a comparison as one HTML file that needs nothing else."""
    carts = dataset.carts
    plots: dict[str, Plot] = {"errors": _errors(comparison)}
    columns: dict[str, Any] = {}
    angles = [held for held in comparison.held if held.angles is not None]
    if angles:
        columns, plots["angles"] = _angles(comparison)
    if carts is not None:
        cart_columns, plots["carts"] = _carts(carts)
        columns |= cart_columns
    headline, advice = _verdict(comparison)
    contents = [item for item in CONTENTS if item[0] != "angles" or angles]
    return render(
        "comparison.html",
        title=f"Models of {robot.name} compared",
        contents=contents if carts is None else [*contents[:-1], ("carts", "The carts' tracks"), contents[-1]],
        plots=plots,
        columns=columns,
        provenance=provenance(dataset, robot, comparison.seed),
        robot=robot.name,
        poses=len(comparison.held[0].position),
        headline=headline,
        advice=advice,
        table=_table(comparison),
        cost=comparison.cost,
        carts=carts is not None,
        turned=bool(angles),
    )


def _verdict(c: Comparison) -> tuple[str, list[str]]:
    """Which model predicts best, and whether that is sure."""
    intervals = {held.model: ends["mean_um"] for held, ends in zip(c.held, c.intervals(), strict=True)}
    means = {held.model: float(held.position.mean() * 1e6) for held in c.held}
    order = sorted(means, key=lambda model: means[model])
    best = order[0]
    words = f"Model {best} ({MODELS[best]}) predicts best"
    if len(order) == 1:
        return f"{words}: it is the only one that these data allow.", [
            "Models 2, 4 and 5 need the carts' tracks in carts.csv."
        ]
    second = order[1]
    top, low = intervals[best], intervals[second]
    sure = top is not None and low is not None and top[1] < low[0]
    headline = (
        f"{words}: {_um(means[best])} mean error on held-out poses, against {_um(means[second])} of model {second}."
    )
    advice = [] if sure else ["Their intervals overlap: these data don't settle which of the two is better."]
    if len(order) < len(MODELS):
        advice.append("Models 2, 4 and 5 need the carts' tracks in carts.csv.")
    return headline, advice


def _um(value: float) -> str:
    return whole(f"{value:.0f} µm")


def _table(c: Comparison) -> Table:
    head = ["model", "what it is", "mean (µm)", "95 %", "rms (µm)", "largest (µm)", "orientation, rms (mrad)", "poses"]
    rows = []
    for held, ends in zip(c.held, c.intervals(), strict=True):
        f = held.figures()
        between = ends["mean_um"] or (float("nan"), float("nan"))
        turned = f["orientation_rms_mrad"]
        rows.append(
            [
                str(held.model),
                MODELS[held.model],
                f"{f['mean_um']:.0f}",
                whole(f"{between[0]:.0f} to {between[1]:.0f}"),
                f"{f['rms_um']:.0f}",
                f"{f['max_um']:.0f}",
                "" if turned is None else f"{turned:.3f}",
                str(len(held.position)),
            ]
        )
    return Table(head, rows)


def _errors(c: Comparison) -> Plot:
    traces = []
    for held, ends in zip(c.held, c.intervals(), strict=True):
        figures = held.figures()
        values = np.array([figures[name] for name in FIGURES], dtype=float)
        between = np.array([ends[name] for name in FIGURES], dtype=float)
        # A resampled maximum never exceeds the one seen, nor need the figure lie amid its interval.
        bars = {
            "type": "data",
            "symmetric": False,
            "array": np.maximum(between[:, 1] - values, 0.0),
            "arrayminus": np.maximum(values - between[:, 0], 0.0),
            "color": "@ink",
            "thickness": 1.2,
        }
        color = {"color": COLORS[held.model]}
        name = f"model {held.model}"
        traces.append(
            {"type": "bar", "name": name, "x": list(FIGURES.values()), "y": values, "error_y": bars, "marker": color}
        )
    layout = {"barmode": "group", "yaxis": {"title": {"text": "position error (µm)"}, "rangemode": "tozero"}}
    return Plot("errors", "Position errors of each model with 95 % intervals", traces, layout, height=360)


def _angles(c: Comparison) -> tuple[dict[str, Any], Plot]:
    """ZYZ Euler angles, measured less predicted, pose by pose."""
    columns: dict[str, Any] = {}
    traces = []
    for held in c.held:
        if held.angles is None:
            continue
        rows = shown(len(held.position))
        columns["place"] = rows
        for k, angle in enumerate(("alpha", "beta", "gamma")):
            columns[f"{angle} {held.model}"] = 1e3 * held.angles[rows, k]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": f"model {held.model}",
                "x": "#place",
                "y": f"#{{angle}} {held.model}",
                "line": {"width": 1.2, "color": COLORS[held.model]},
            }
        )
    layout = {
        "xaxis": {"title": {"text": "held-out pose, in the dataset's order"}},
        "yaxis": {"title": {"text": "${angle} (mrad)"}},
    }
    return columns, Plot("angles", "Orientation errors pose by pose", traces, layout, height=340)


def _carts(carts: CartMeasurements) -> tuple[dict[str, Any], Plot]:
    columns: dict[str, Any] = {}
    traces = []
    for j in range(carts.n_actuators):
        line = Linearity.of(carts, j + 1)
        rows = shown(len(line.q))
        columns[f"travel {j}"], columns[f"off {j}"] = line.q[rows], 1e6 * line.absolute[rows]
        traces.append(
            {"type": "scatter", "mode": "lines", "name": f"cart {j + 1}", "x": f"#travel {j}", "y": f"#off {j}"}
        )
    layout = {
        "xaxis": {"title": {"text": "commanded position (m)"}},
        "yaxis": {"title": {"text": "off a straight line (µm)"}, "rangemode": "tozero"},
    }
    return columns, Plot(
        "carts", "What a straight line leaves of each cart's measured track", traces, layout, height=320
    )
