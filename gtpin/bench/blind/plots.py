"""Plots of a score."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from gtpin.bench.blind.figures import of_kind
from gtpin.bench.blind.judged import VISIBLE, Judged
from gtpin.bench.blind.score import EDGES, matched_filter
from gtpin.report.embedded import Plot
from gtpin.report.figure import ACCENT, BAD, DATA, FIT, GOOD, LOW, MID, MYSTERY, WARN, ZERO, Drawing

COLORS = (ACCENT, FIT, GOOD, MYSTERY)
DOTTED = {"color": ZERO, "dash": "dot"}
Trace = dict[str, Any]


def plots(result: Mapping[str, Any], cases: Sequence[Judged]) -> dict[str, Plot]:
    """By name: ``reliability``, ``power``, ``confusion``, ``shrinkage``, ``difficulty``; plots without data are omitted."""
    made = (
        _reliability(result["reliability"]),
        _power(result["power"]),
        _confusion(result["confusion"]),
        _explained_fraction(cases),
        _difficulty(cases),
    )
    return {plot.name: plot for plot in made if plot is not None}


def _plot(name: str, title: str, caption: str, traces: Sequence[Trace], layout: Trace, **more: Any) -> Plot:
    return Plot(name, title, partial(Drawing, traces, layout), (), caption, **more)


def _axis(title: str, low: float | None = None, high: float | None = None, **more: Any) -> Trace:
    return {"title": {"text": title}, **({} if low is None else {"range": [low, high]}), **more}


def _diagonal(start: float) -> Trace:
    """A dotted line of equal numbers, without a legend."""
    ends = [start, 1]
    return {"x": ends, "y": ends, "mode": "lines", "line": DOTTED, "showlegend": False, "hoverinfo": "skip"}


def _rates(x: Sequence[float], rates: Sequence[Mapping[str, Any]], **more: Any) -> Trace:
    """Rates with their bounds, and their numbers of cases as text."""
    above, below = [r["high"] - r["value"] for r in rates], [r["value"] - r["low"] for r in rates]
    bars = {"type": "data", "symmetric": False, "array": above, "arrayminus": below, "thickness": 1}
    texts = [f"{r['of']} cases" for r in rates]
    return {"x": x, "y": [r["value"] for r in rates], "error_y": bars, "text": texts, **more}


def _reliability(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> Plot | None:
    traces = [_diagonal(0)]
    for (name, tenths), color in zip(rows.items(), COLORS, strict=False):
        said, right = [t["said"] for t in tenths], [t["right"] for t in tenths]
        traces.append(_rates(said, right, name=name, mode="markers", marker={"color": color, "size": 8}))
    caption = "Probabilities of the named causes, and of all members of their classes, by tenths; bars: 95 %."
    axes = {"xaxis": _axis("predicted probability", 0, 1.02), "yaxis": _axis("fraction correct", -0.02, 1.02)}
    title = "Reliability of the probabilities"
    return _plot("reliability", title, caption, traces, axes) if rows["causes"] else None


def _power(rows: Sequence[Mapping[str, Any]]) -> Plot | None:
    if not rows:
        return None
    grid = np.geomspace(EDGES[0], EDGES[-1], 60)
    limit = [matched_filter(e) for e in grid]
    traces: list[Trace] = [{"x": grid, "y": limit, "mode": "lines", "name": "matched filter", "line": DOTTED}]
    for number, color in zip(sorted({row["poses"] for row in rows}), COLORS, strict=False):
        some = [row for row in rows if row["poses"] == number]
        found = [row["found"] for row in some]
        look = {"name": f"{number} poses", "mode": "lines+markers", "line": {"color": color}}
        traces.append(_rates([row["energy"] for row in some], found, **look))
    caption = "Single effects by the energy that geometry can't explain; bars: 95 %."
    axes = {"xaxis": _axis("E", type="log"), "yaxis": _axis("share detected", -0.02, 1.05)}
    return _plot("power", "Share detected by energy", caption, traces, axes)


def _confusion(counts: Mapping[str, Mapping[str, int]]) -> Plot | None:
    if not counts:
        return None
    last = ["unknown", "ambiguous", "explained", "none", "failed"]
    named = sorted({word for row in counts.values() for word in row} - set(last))
    words = [*dict.fromkeys([*counts, *named]), *last]
    columns = [word for word in words if any(word in row for row in counts.values())]
    trace = {
        "type": "heatmap",
        "x": columns,
        "y": list(counts),
        "z": [[row.get(word, 0) / sum(row.values()) for word in columns] for row in counts.values()],
        "text": [[row.get(word, 0) or "" for word in columns] for row in counts.values()],
        "texttemplate": "%{text}",
        "showscale": False,
        "colorscale": [[0, LOW], [1, MID]],
        "hovertemplate": "%{y} diagnosed as %{x}: %{text}<extra></extra>",
        "xgap": 1,
        "ygap": 1,
    }
    axes = {"yaxis": {"autorange": "reversed"}, "xaxis": {"side": "top", "tickangle": -60}}
    layout: Trace = {**axes, "margin": {"t": 110}}
    caption = "Numbers of cases, by the true effect (rows) and the leading cause, or the verdict if no cause is named."
    title = "Confusion matrix of single effects"
    return _plot("confusion", title, caption, [trace], layout, height=130 + 24 * len(counts))


def _explained_fraction(cases: Sequence[Judged]) -> Plot | None:
    some = [
        (c, c.said.explained_fraction, c.shrunk.share)
        for c in cases
        if c.said and c.shrunk and c.said.explained_fraction is not None
    ]
    if not some:
        return None
    dots = {
        "x": [predicted for _, predicted, _ in some],
        "y": [max(share, -1.0) for _, _, share in some],
        "mode": "markers",
        "name": "cases",
        "marker": {"color": DATA, "size": 5, "opacity": 0.6},
        "text": [c.name for c, _, _ in some],
    }
    axes: Trace = {"xaxis": _axis("predicted"), "yaxis": _axis("realised at held-out commands"), "showlegend": False}
    title = "Explained fraction of the gap, predicted and realised"
    caption = "One dot per case; values below -1 are drawn at -1."
    return _plot("shrinkage", title, caption, [_diagonal(-0.2), dots], axes)


def _difficulty(cases: Sequence[Judged]) -> Plot | None:
    one = [c for c in of_kind(cases, "one") if c.noncentrality == c.noncentrality and c.leaves == c.leaves]
    if not one:
        return None
    rest = [c for c in one if not c.strict]
    groups = {
        "right, alone": (GOOD, [c for c in one if c.strict]),
        "class holds it": (WARN, [c for c in rest if c.detected and c.in_class]),
        "wrong or unknown": (BAD, [c for c in rest if c.detected and not c.in_class]),
        "not detected": (DATA, [c for c in rest if not c.detected]),
    }
    traces = []
    for name, (color, some) in groups.items():
        look = {"mode": "markers", "name": name, "marker": {"color": color, "size": 6}}
        x, y = [c.noncentrality for c in some], [max(c.leaves, 1.0) for c in some]
        traces.append({"x": x, "y": y, "text": [f"{c.name} {c.single.name}" for c in some], **look})
    line = {"type": "line", "y0": VISIBLE, "y1": VISIBLE, "xref": "paper", "x0": 0, "x1": 1, "line": DOTTED}
    axes: Trace = {"xaxis": _axis("E", type="log"), "yaxis": _axis("D", type="log"), "shapes": [line]}
    title, caption = "Energy, and what the best wrong effect leaves", "Single effects; dotted: D = 63."
    return _plot("difficulty", title, caption, traces, axes)
