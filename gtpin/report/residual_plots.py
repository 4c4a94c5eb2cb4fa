"""Plots of what is left of the measurements against each command and covariate, with what the causes make of it on top."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.report.fit_along import Along, fit_along
from gtpin.report.page import Choice, Plot, escaped
from gtpin.report.residuals import AXES, Residuals, evenly
from gtpin.report.words import coordinate_words, covariate_unit, typeset, with_unit

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
BEFORE = "layer=before"
"""The choice for which a trace is drawn: the causes say nothing of the residuals that they themselves leave."""


def shown(count: int) -> npt.NDArray[np.intp]:
    """The rows that plots show."""
    return evenly(count, MOST)


def selection(residuals: Residuals) -> str:
    """How many of the poses the plots show, where that is not all."""
    drawn = len(shown(len(residuals)))
    if drawn == residuals.used:
        return ""
    means = "" if len(residuals) == residuals.used else f", and their lines come from {len(residuals):,}"
    return f"The plots show {drawn:,} of {residuals.used:,} measurements{means}, selected evenly."


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
    """Residuals against each command and covariate that varies: those that a cause goes with first, with its line.

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
    few = {name for name, values in known.items() if name == "session" or len(np.unique(values.astype(float))) <= FEW}
    lines = {name: fit_along(residuals, name) if causes else None for name in known if name not in few}
    columns: dict[str, Any] = {f"at {name}": q[shown(len(q))] for name, q in commanded(residuals).items()}
    plots = []
    for name in sorted(known, key=lambda name: (lines.get(name) is None, -share.get(name, 0.0))):
        if name in few:
            columns |= _kinds(name, known[name])
            plots.append(_boxes(residuals, name, causes))
        else:
            columns |= _numbers(residuals, name, known[name].astype(float), lines[name])
            plots.append(_dots(residuals, name, causes, lines[name] is not None))
    return columns, plots


def _kinds(name: str, values: npt.NDArray[np.generic]) -> dict[str, Any]:
    """A column of few values: those of the poses, in words, and each once, in order."""
    words = [escaped(str(v) if name == "session" else typeset(f"{float(v):g}")) for v in values.tolist()]
    order = dict.fromkeys(words[i] for i in np.argsort(values, kind="stable"))
    return {f"kind of {name}": [words[i] for i in shown(len(words))], f"kinds of {name}": list(order)}


def _numbers(residuals: Residuals, name: str, values: Floats, line: Along | None) -> dict[str, Any]:
    """A column of numbers, and over it the means of neighbouring poses or the causes' line.

    The line stands in the place of the means, which would smooth a short period away.
    """
    columns = {f"at {name}": values[shown(len(residuals))]} | _means(residuals, name, values)
    if line is not None:
        columns[f"along {name}"] = line.x
        for component in residuals.component_names:
            factor, _ = scale_of(residuals.component(component, residuals.before), residuals.unit(component))
            columns[f"before {component} along {name}"] = factor * line.fit[component]
            columns[f"after {component} along {name}"] = []
            columns[f"before {component} over {name}"] = []
    return columns


def _means(residuals: Residuals, name: str, values: Floats) -> dict[str, Any]:
    """Means of groups of neighbouring poses; poses of one value are never parted."""
    count = min(GROUPS, max(1, len(values) // 6))
    group = np.searchsorted(np.unique(np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1])), values)
    groups = [np.flatnonzero(group == k) for k in np.unique(group)]
    columns: dict[str, Any] = {f"at {name} mean": np.array([values[rows].mean() for rows in groups])}
    for component in residuals.component_names:
        for layer, left in (("before", residuals.before), ("after", residuals.after)):
            seen = residuals.component(component, left)
            factor, _ = scale_of(residuals.component(component, residuals.before), residuals.unit(component))
            columns[f"{layer} {component} over {name}"] = factor * np.array([seen[rows].mean() for rows in groups])
    return columns


def _dots(residuals: Residuals, name: str, causes: bool, line: bool) -> Plot:
    told = {"x": f"#at {name}", "type": "scatter", "mode": "markers", "text": "#pose"}
    told["hovertemplate"] = f"%{{y}} at {escaped(name)} = %{{x}}<br>pose %{{text}}<extra></extra>"
    traces: list[dict[str, Any]] = [
        told | {"y": "#{layer} {component}", "name": "residual", "marker": POINTS | {"color": "@data"}}
    ]
    if causes:
        look = {"name": "what the causes make of it", "meta": BEFORE, "marker": POINTS | {"color": "@fit"}}
        traces.append(told | look | {"y": "#{layer} fit {component}"})
    plain = {"type": "scatter", "mode": "lines", "hoverinfo": "skip"}
    if line:
        look = {"name": "the same along the column, all else at its middle", "meta": BEFORE}
        ends = {"x": f"#along {name}", "y": f"#{{layer}} {{component}} along {name}"}
        traces.append(plain | look | ends | {"line": {"color": "@fit", "width": 1.4}})
    ends = {"x": f"#at {name} mean", "y": f"#{{layer}} {{component}} over {name}"}
    traces.append(plain | ends | {"name": "mean of neighbouring poses", "line": {"color": "@ink", "width": 1.6}})
    return _plot(residuals, name, traces, {}, whole=line)


def _boxes(residuals: Residuals, name: str, causes: bool) -> Plot:
    told = {"x": f"#kind of {name}", "type": "box", "boxpoints": False, "hoverinfo": "y"}
    look: dict[str, Any] = {"name": "residuals of one value: median, quartiles, ends", "marker": {"color": "@data"}}
    traces = [told | look | {"y": "#{layer} {component}"}]
    if causes:
        look = {"name": "what the causes make of them", "meta": BEFORE, "marker": {"color": "@fit"}}
        traces.append(told | look | {"y": "#{layer} fit {component}"})
    order = {"categoryorder": "array", "categoryarray": f"#kinds of {name}"}
    return _plot(residuals, name, traces, {"type": "category", "automargin": "height"} | order)


def _plot(
    residuals: Residuals, name: str, traces: list[dict[str, Any]], axis: dict[str, Any], whole: bool = False
) -> Plot:
    number = name[1:] if name.startswith("q") else ""
    turns = number.isdigit() and residuals.model.robot.actuators[int(number) - 1].revolute
    x_title = escaped(with_unit(name, covariate_unit(name, turns)))
    # Numbers are told in the axes' formats: unlike those of a hover template, they have a true minus sign.
    layout = {
        "xaxis": {"title": {"text": x_title}, "hoverformat": ".4g"} | axis,
        "yaxis": {"title": {"text": "${component}"}, "hoverformat": ".3g"},
        "showlegend": False,
        "boxmode": "group",
        "margin": {"t": 10},
    }
    title = f"Residuals against {coordinate_words(name)}"
    return Plot(f"against-{name}", title, traces, layout, height=280 if whole else 230, whole=whole)
