"""Figures of effects' curves."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.estimate import WIDE
from gtpin.report.effect_curves import CurveLine, EffectCurve
from gtpin.report.embedded import Plot, escaped
from gtpin.report.figure import Drawing, scatter, titled
from gtpin.report.palette import CURVES, DATA
from gtpin.report.residual_columns import scale_of
from gtpin.report.residual_plots import POINTS, shown
from gtpin.report.words import joined, quantity

MOST = 6
"""Largest number of curves that are drawn per effect."""


def drawn_curves(found: Sequence[EffectCurve]) -> list[EffectCurve]:
    """The curves of an effect that are drawn: those that differ from zero."""
    return ([curve for curve in found if curve.seen] or list(found[:1]))[:MOST]


def curve_plots(name: str, found: Sequence[EffectCurve]) -> list[Plot]:
    """Plots of an effect's curves.

    ``name``: beginning of the plots' names.
    """
    return [
        Plot(f"{name}-{i}", f"{curve.name} against {curve.x_title}", partial(curve_drawing, curve), height=300)
        for i, curve in enumerate(drawn_curves(found))
    ]


def curve_drawing(curve: EffectCurve) -> Drawing:
    """A curve of an effect with its 95 % interval, and the measurements less everything else that the model explains."""
    factor, unit = scale_of(np.concatenate([line.y for line in curve.lines]), curve.unit)
    traces: list[dict[str, Any]] = []
    for k, line in enumerate(curve.lines):
        traces += _traces(curve, line, factor, *CURVES[k % len(CURVES)], rank=2 * k + 1)
    return Drawing(traces, _layout(curve, factor, unit))


def curve_notes(found: Sequence[EffectCurve]) -> list[str]:
    """Notes on an effect's curves: how to read them, and which quantities have no detected displacement."""
    if not found:
        return []
    taken = "mean and a straight line" if any(curve.straightened for curve in found) else "mean"
    held = " Other coordinates on which it depends are held constant." if any(curve.smooth for curve in found) else ""
    notes = [
        f"Curves are without their {taken}, which geometry absorbs; bands: 95 %.{held} Dots: the measurements without "
        "everything else that the model explains."
    ]
    names = dict.fromkeys(curve.name for curve in found)
    seen = {curve.name for curve in found if curve.seen}
    hidden = [name for name in names if name not in seen]
    return notes + ([f"Not detected, but possible for this effect: {joined(hidden)}."] if hidden else [])


def reach(found: Sequence[EffectCurve]) -> str:
    """The largest displacement by an effect in each unit, as text; for a robot without rods also its motion of the TCP."""
    words = []
    for unit in ("m", "rad"):
        ranges = {curve.name: curve.range for curve in found if curve.unit == unit and curve.seen}
        if not ranges:
            continue
        most = max(ranges, key=lambda name: ranges[name])
        lever = next(curve.lever for curve in found if curve.name == most)
        told = f"{most}: {quantity(ranges[most], unit)} peak to peak"
        if lever is not None and not most.startswith("shift along"):  # such a shift is the TCP's own
            told += f", {quantity(lever * ranges[most], 'm')} at the TCP"
        words.append(told)
    return "; ".join(words)


def _texts(x: npt.NDArray[np.generic]) -> Any:
    """Values of x as plotly takes them: sessions are text."""
    return [escaped(str(s)) for s in x] if x.dtype == object else x


def _traces(
    curve: EffectCurve, line: CurveLine, factor: float, color: str, band: str, rank: int
) -> list[dict[str, Any]]:
    rows, thin = shown(len(line.points_x)), shown(len(line.x))
    x, y, reach = _texts(line.x[thin]), factor * line.y[thin], factor * WIDE * line.sigma[thin]
    points = scatter(
        "markers",
        _texts(line.points_x[rows]),
        factor * line.points_y[rows],
        name="measured",
        marker=POINTS | {"color": color if len(curve.lines) > 1 else DATA},
        legendrank=rank + 1,
        showlegend=len(line.points_x) > 0,
        hoverinfo="x+y",
    )
    effect = {"name": line.label or f"effect, 95 % {'band' if curve.smooth else 'bars'}", "legendrank": rank}
    if not curve.smooth:
        bars = {"type": "data", "array": reach, "color": color, "thickness": 1, "width": 0}
        return [points, scatter("markers", x, y, marker={"color": color, "size": 5}, error_y=bars, **effect)]
    # The band is filled in two parts, below and above the effect, so that the legend shows the effect on its band.
    filled = {"fill": "tonexty", "fillcolor": band}
    edge = {"hoverinfo": "skip", "showlegend": False, "line": {"width": 0}}
    return [
        points,
        scatter("lines", x, y - reach, **edge),
        scatter("lines", x, y, line={"color": color, "width": 2.2}, **filled, **effect),
        scatter("lines", x, y + reach, **edge, **filled),
    ]


def _layout(curve: EffectCurve, factor: float, unit: str) -> dict[str, Any]:
    points = np.concatenate([line.points_y for line in curve.lines])
    ends = np.concatenate([line.y + s * WIDE * line.sigma for line in curve.lines for s in (-1.0, 1.0)])
    # A few distant points must not flatten the curve.
    inner = np.quantile(points, (0.01, 0.99)) if len(points) else np.zeros(2)
    low, high = min(inner[0], float(ends.min())), max(inner[1], float(ends.max()))
    room = 0.06 * max(high - low, 1e-12)
    layout = titled(escaped(curve.x_title), "", legend={"traceorder": "normal"})
    if curve.categories:
        order = _texts(curve.lines[0].x)
        layout["xaxis"] |= {
            "type": "category",
            "automargin": "height",
            "categoryorder": "array",
            "categoryarray": order,
        }
    layout["yaxis"] = {"range": [factor * (low - room), factor * (high + room)]}
    place = {"x": 0, "xref": "container", "yref": "container", "y": 1, "yanchor": "top", "pad": {"t": 6}}
    layout["title"] = {"text": f"{escaped(curve.name)} ({unit})", "font": {"size": 13}} | place
    layout["margin"] = {"t": 58 if len(curve.lines) == 1 else 70}  # room for a legend of two rows
    return layout
