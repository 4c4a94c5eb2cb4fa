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
from gtpin.report.figure import Drawing
from gtpin.report.palette import ACCENT, BAD, DATA, FIT, GOOD, LOW, MID, MYSTERY, WARN, ZERO

COLORS = (ACCENT, FIT, GOOD, MYSTERY)


def plots(result: Mapping[str, Any], cases: Sequence[Judged]) -> dict[str, Plot]:
    """By name: ``reliability``, ``power``, ``confusion``, ``shrinkage``, ``difficulty``; plots without data are omitted."""
    made = {
        "reliability": _reliability(result["reliability"]),
        "power": _power(result["power"]),
        "confusion": _confusion(result["confusion"]),
        "shrinkage": _shrinkage(cases),
        "difficulty": _difficulty(cases),
    }
    return {name: plot for name, plot in made.items() if plot is not None}


def _bounds(rates: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Error bars of rates."""
    above = [r["high"] - r["value"] for r in rates]
    below = [r["value"] - r["low"] for r in rates]
    return {"type": "data", "symmetric": False, "array": above, "arrayminus": below, "thickness": 1}


def _reliability(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> Plot | None:
    traces: list[dict[str, Any]] = [
        {
            "x": [0, 1],
            "y": [0, 1],
            "mode": "lines",
            "line": {"color": ZERO, "dash": "dot"},
            "showlegend": False,
            "hoverinfo": "skip",
        }
    ]
    for (name, tenths), color in zip(rows.items(), COLORS, strict=False):
        rates = [t["right"] for t in tenths]
        traces.append(
            {
                "x": [t["said"] for t in tenths],
                "y": [r["value"] for r in rates],
                "name": name,
                "mode": "markers",
                "error_y": _bounds(rates),
                "marker": {"color": color, "size": 8},
                "text": [f"{r['of']} cases" for r in rates],
            }
        )
    layout = {
        "xaxis": {"title": {"text": "predicted probability"}, "range": [0, 1.02]},
        "yaxis": {"title": {"text": "fraction correct"}, "range": [-0.02, 1.02]},
    }
    caption = "Probabilities of the named causes, and of all members of their classes, by tenths; bars: 95 %."
    return (
        Plot("reliability", "Reliability of the probabilities", partial(Drawing, traces, layout), (), caption)
        if rows["causes"]
        else None
    )


def _power(rows: Sequence[Mapping[str, Any]]) -> Plot | None:
    if not rows:
        return None
    grid = np.geomspace(EDGES[0], EDGES[-1], 60)
    traces: list[dict[str, Any]] = [
        {
            "x": grid,
            "y": [matched_filter(e) for e in grid],
            "mode": "lines",
            "name": "matched filter",
            "line": {"color": ZERO, "dash": "dot"},
        }
    ]
    for number, color in zip(sorted({row["poses"] for row in rows}), COLORS, strict=False):
        some = [row for row in rows if row["poses"] == number]
        rates = [row["found"] for row in some]
        traces.append(
            {
                "x": [row["energy"] for row in some],
                "y": [r["value"] for r in rates],
                "name": f"{number} poses",
                "mode": "lines+markers",
                "error_y": _bounds(rates),
                "line": {"color": color},
                "text": [f"{r['of']} cases" for r in rates],
            }
        )
    layout = {
        "xaxis": {"type": "log", "title": {"text": "E"}},
        "yaxis": {"title": {"text": "share detected"}, "range": [-0.02, 1.05]},
    }
    return Plot(
        "power",
        "Share detected by energy",
        partial(Drawing, traces, layout),
        (),
        "Single effects by the energy that geometry can't explain; bars: 95 %.",
    )


def _confusion(counts: Mapping[str, Mapping[str, int]]) -> Plot | None:
    if not counts:
        return None
    last = ["unknown", "ambiguous", "explained", "none", "failed"]
    named = sorted({word for row in counts.values() for word in row} - set(last))
    columns = [
        word for word in [*dict.fromkeys([*counts, *named]), *last] if any(word in row for row in counts.values())
    ]
    shares = [[row.get(word, 0) / sum(row.values()) for word in columns] for row in counts.values()]
    texts = [[row.get(word, 0) or "" for word in columns] for row in counts.values()]
    trace = {
        "type": "heatmap",
        "x": columns,
        "y": list(counts),
        "z": shares,
        "text": texts,
        "texttemplate": "%{text}",
        "showscale": False,
        "colorscale": [[0, LOW], [1, MID]],
        "hovertemplate": "%{y} diagnosed as %{x}: %{text}<extra></extra>",
        "xgap": 1,
        "ygap": 1,
    }
    layout = {"yaxis": {"autorange": "reversed"}, "xaxis": {"side": "top", "tickangle": -60}, "margin": {"t": 110}}
    caption = (
        "Rows: the true effect; columns: the leading cause, or the verdict if no cause is named. Numbers of cases."
    )
    return Plot(
        "confusion",
        "Confusion matrix of single effects",
        partial(Drawing, [trace], layout),
        (),
        caption,
        height=130 + 24 * len(counts),
    )


def _shrinkage(cases: Sequence[Judged]) -> Plot | None:
    some = [c for c in cases if c.said and c.shrunk and c.said.shrinkage is not None]
    if not some:
        return None
    line = {
        "x": [-0.2, 1],
        "y": [-0.2, 1],
        "mode": "lines",
        "line": {"color": ZERO, "dash": "dot"},
        "showlegend": False,
        "hoverinfo": "skip",
    }
    dots = {
        "x": [c.said.shrinkage for c in some if c.said],
        "y": [max(c.shrunk.share, -1.0) for c in some if c.shrunk],
        "mode": "markers",
        "name": "cases",
        "marker": {"color": DATA, "size": 5, "opacity": 0.6},
        "text": [c.name for c in some],
    }
    layout = {
        "xaxis": {"title": {"text": "predicted"}},
        "yaxis": {"title": {"text": "realised at held-out commands"}},
        "showlegend": False,
    }
    return Plot(
        "shrinkage",
        "Explained fraction of the gap, predicted and realised",
        partial(Drawing, [line, dots], layout),
        (),
        "One dot per case; values below -1 are drawn at -1.",
    )


def _difficulty(cases: Sequence[Judged]) -> Plot | None:
    one = [c for c in of_kind(cases, "one") if c.energy == c.energy and c.leaves == c.leaves]
    if not one:
        return None
    groups = (("right, alone", GOOD), ("class holds it", WARN), ("wrong or unknown", BAD), ("not detected", DATA))
    traces = []
    for number, (name, color) in enumerate(groups):
        some = [c for c in one if _group(c) == number]
        traces.append(
            {
                "x": [c.energy for c in some],
                "y": [max(c.leaves, 1.0) for c in some],
                "mode": "markers",
                "name": name,
                "marker": {"color": color, "size": 6},
                "text": [f"{c.name} {c.single.name}" for c in some],
            }
        )
    lines = [
        {
            "type": "line",
            "y0": VISIBLE,
            "y1": VISIBLE,
            "xref": "paper",
            "x0": 0,
            "x1": 1,
            "line": {"color": ZERO, "dash": "dot"},
        }
    ]
    layout = {
        "xaxis": {"type": "log", "title": {"text": "E"}},
        "yaxis": {"type": "log", "title": {"text": "D"}},
        "shapes": lines,
    }
    return Plot(
        "difficulty",
        "Energy, and what the best wrong effect leaves",
        partial(Drawing, traces, layout),
        (),
        "Single effects; dotted: D = 63.",
    )


def _group(case: Judged) -> int:
    if case.strict:
        return 0
    if not case.detected:
        return 3
    return 1 if case.in_class else 2
