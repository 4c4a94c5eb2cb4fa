"""Plots of what is left of the measurements against each command and covariate, with what the causes make of it on top."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.report.page import Choice, Plot, escaped
from gtpin.report.residuals import AXES, Residuals
from gtpin.report.words import coordinate_words, covariate_unit, with_unit

Floats = npt.NDArray[np.float64]

MOST = 1500
"""Poses that a plot shows; more of them are thinned evenly."""
POINTS = {"size": 4.5, "opacity": 0.6}
FEW = 8
"""Values up to which a covariate is shown as boxes side by side."""
GROUPS = 18
"""Groups of neighbouring poses whose means are drawn."""
LAYERS = Choice("layer", "Left by", (("before", "geometry alone"), ("after", "geometry with the causes")))
ONE_LAYER = Choice("layer", "Left by", LAYERS.options[:1])
"""Where there are no causes."""


def shown(count: int) -> npt.NDArray[np.intp]:
    """The rows that plots show."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(np.intp))


def scale_of(values: Floats, unit: str) -> tuple[float, str]:
    """A factor to thousandths or millionths of m or rad, whichever reads better, and the unit's name."""
    largest = float(np.abs(values).max(initial=0.0))
    return (1e3, f"m{unit}") if largest >= 2e-3 else (1e6, f"µ{unit}")


def leading(residuals: Residuals, sites: Sequence[str], axes: Mapping[str, float]) -> str:
    """Along what residuals are seen first: the travel of the first of the sites that has any, else the axis of most share."""
    for site in sites:
        if site in residuals.model.robot.sites:
            return site
    return max((axis for axis in AXES[: residuals.components]), key=lambda axis: axes.get(axis, 0.0))


def components(residuals: Residuals, first: str) -> tuple[dict[str, Any], Choice]:
    """Columns ``before``, ``after`` and ``before fit`` of every component, and the choice between components."""
    rows = shown(len(residuals))
    columns: dict[str, Any] = {"pose": [escaped(str(p)) for p in residuals.dataset.pose[rows]]}
    options = []
    for name in residuals.component_names:
        before, after = residuals.component(name, residuals.before), residuals.component(name, residuals.after)
        factor, unit = scale_of(before, residuals.unit(name))
        columns[f"before {name}"] = factor * before[rows]
        columns[f"after {name}"] = factor * after[rows]
        columns[f"before fit {name}"] = factor * (before - after)[rows]
        columns[f"after fit {name}"] = []
        options.append((name, f"{name} ({unit})" if name in AXES else f"travel of {name} ({unit})"))
    options.sort(key=lambda option: option[0] != first)
    return columns, Choice("component", "Seen along", tuple(options))


def commanded(residuals: Residuals) -> dict[str, Floats]:
    """The commands by name: q1 .. qn."""
    return {f"q{j + 1}": residuals.dataset.q[:, j] for j in range(residuals.dataset.n_actuators)}


def over_two(residuals: Residuals, a: str, b: str) -> Plot:
    """What is left over two commands together, in colour: for what goes with both at once."""
    color = {"colorscale": [[0, "@accent"], [0.5, "@low"], [1, "@high"]], "cmid": 0, "color": "#after {component}"}
    bar = {"thickness": 9, "outlinewidth": 0, "title": {"text": "${component}", "side": "right"}}
    trace = {
        "x": f"#at {a}",
        "y": f"#at {b}",
        "type": "scatter",
        "mode": "markers",
        "marker": {"size": 8, "line": {"color": "@zero", "width": 0.5}, "showscale": True, "colorbar": bar} | color,
        "text": "#pose",
        "hovertemplate": "%{marker.color:.3g}<br>pose %{text}<extra></extra>",
    }
    layout = {"xaxis": {"title": {"text": f"{a} (m)"}}, "yaxis": {"title": {"text": f"{b} (m)"}}, "margin": {"t": 10}}
    return Plot("left", f"What is left over {a} and {b}", [trace], layout, height=340)


def against_covariates(
    residuals: Residuals, share: Mapping[str, float], causes: bool
) -> tuple[dict[str, Any], list[Plot]]:
    """Residuals against each command and covariate that varies.

    Parameters
    ----------
    share
        How telling each is; the most telling come first.
    causes
        Whether there are any, whose part is drawn on top.
    """
    data = residuals.dataset
    known: dict[str, npt.NDArray[np.generic]] = dict(commanded(residuals))
    known |= {name: values for name, values in data.covariates.items() if bool((values != values[0]).any())}
    columns: dict[str, Any] = {}
    plots = []
    for name in sorted(known, key=lambda name: -share.get(name, 0.0)):
        few = name == "session" or len(np.unique(known[name].astype(float))) <= FEW
        values = np.array([escaped(str(v)) for v in known[name]], dtype=object) if few else known[name].astype(float)
        columns[f"at {name}"] = values[shown(len(residuals))]
        if not few:
            columns |= _means(residuals, name, np.asarray(values, dtype=float))
        plots.append(_boxes(residuals, name, causes) if few else _dots(residuals, name, causes))
    return columns, plots


def _means(residuals: Residuals, name: str, values: Floats) -> dict[str, Any]:
    """Means of groups of neighbouring poses."""
    groups = np.array_split(np.argsort(values, kind="stable"), min(GROUPS, max(1, len(values) // 6)))
    columns: dict[str, Any] = {f"at {name} mean": np.array([values[rows].mean() for rows in groups])}
    for component in residuals.component_names:
        for layer, left in (("before", residuals.before), ("after", residuals.after)):
            seen = residuals.component(component, left)
            factor, _ = scale_of(residuals.component(component, residuals.before), residuals.unit(component))
            columns[f"{layer} {component} over {name}"] = factor * np.array([seen[rows].mean() for rows in groups])
    return columns


def _dots(residuals: Residuals, name: str, causes: bool) -> Plot:
    told = {"x": f"#at {name}", "type": "scatter", "mode": "markers", "text": "#pose"}
    hover = {"hovertemplate": f"%{{y:.3g}} at {escaped(name)} = %{{x:.4g}}<br>pose %{{text}}<extra></extra>"}
    traces: list[dict[str, Any]] = [told | hover | {"y": "#{layer} {component}", "marker": POINTS | {"color": "@data"}}]
    if causes:
        traces.append(told | hover | {"y": "#{layer} fit {component}", "marker": POINTS | {"color": "@fit"}})
    mean = {"color": "@ink", "width": 1.6, "shape": "spline", "smoothing": 0.6}
    traces.append(
        {
            "x": f"#at {name} mean",
            "y": f"#{{layer}} {{component}} over {name}",
            "type": "scatter",
            "mode": "lines",
            "line": mean,
            "hoverinfo": "skip",
        }
    )
    return _plot(residuals, name, traces, {})


def _boxes(residuals: Residuals, name: str, causes: bool) -> Plot:
    told = {"x": f"#at {name}", "type": "box", "boxpoints": False, "hoverinfo": "y"}
    traces = [told | {"y": "#{layer} {component}", "marker": {"color": "@data"}}]
    if causes:
        traces.append(told | {"y": "#{layer} fit {component}", "marker": {"color": "@fit"}})
    return _plot(
        residuals, name, traces, {"type": "category", "categoryorder": "category ascending", "automargin": "height"}
    )


def _plot(residuals: Residuals, name: str, traces: list[dict[str, Any]], axis: dict[str, Any]) -> Plot:
    number = name[1:] if name.startswith("q") else ""
    turns = number.isdigit() and residuals.model.robot.actuators[int(number) - 1].revolute
    layout = {
        "xaxis": {"title": {"text": escaped(with_unit(name, covariate_unit(name, turns)))}} | axis,
        "yaxis": {"title": {"text": "${component}"}},
        "showlegend": False,
        "boxmode": "group",
        "margin": {"t": 10},
    }
    return Plot(f"against-{name}", f"Residuals against {coordinate_words(name)}", traces, layout, height=230)
