"""Polar plots of circular tests: magnified deviations of the radius, as usual for ball bars."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.errors import DatasetError
from gtpin.report.ball_bar import Circle, Layer, circles
from gtpin.report.embedded import Plot, escaped
from gtpin.report.figure import ACCENT, FIT, LIGHT, LINE, ZERO, Drawing, alone, round_below
from gtpin.report.residual_plots import scale_of
from gtpin.report.residuals import Residuals
from gtpin.report.words import quantity, typeset

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

COLORS = {"counterclockwise": ACCENT, "clockwise": FIT}
INSIDE, OUTSIDE = 2.2, 1.15
"""Space in the plot inside and outside the circle of zero deviation, over the largest deviation."""
ROUND = np.linspace(0.0, 360.0, 181)
"""Angles of a drawn circle, degrees."""
LAYERS: dict[Layer, str] = {
    "measured": "As measured",
    "before": "Left by geometry alone",
    "after": "Left by geometry with the causes",
}


def circular_tests(residuals: Residuals, causes: bool) -> list[tuple[str, list[Plot]]]:
    """The titles of the circles along which readings were taken, each with one plot for each layer.

    ``causes``: whether there are causes: a last layer then shows the residuals with them.
    """
    layers, margin = _layers(causes), {"t": 24, "b": 24, "l": 30, "r": 30}

    def draw(circle: Circle, layer: Layer) -> Drawing:
        layout = {"polar": _polar(circle, layer, layers), "showlegend": False, "margin": margin}
        return Drawing(_traces(residuals, circle, layer, layers), layout)

    def plot(number: int, circle: Circle, layer: Layer) -> Plot:
        name, title = f"circle-{number}-{layer}", f"{_name(circle)}: {LAYERS[layer].lower()}"
        caption = f"{'. '.join(_words(circle, layer, layers))}."
        return Plot(name, title, partial(draw, circle, layer), caption=caption, height=300)

    found = enumerate(circles(residuals))
    return [(_name(circle), [plot(k, circle, layer) for layer in layers]) for k, circle in found]


def ball_bar_figure(residuals: Residuals, number: int, causes: bool) -> Figure:
    """The layers of a circle, side by side; ``number``: its index in the data, ``causes``: as in :func:`circular_tests`.

    Raises `DatasetError` if there is no such circle.
    """
    found = circles(residuals)
    if not found:
        hint = "a circular test has readings of a range instrument along half a turn or more about its station"
        raise DatasetError("no readings lie on circles", hint=hint)
    if not 0 <= number < len(found):
        raise DatasetError(f"there is no circle {number}", hint=f"there are {len(found)}, counted from 0")
    circle, layers = found[number], _layers(causes)
    traces: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"annotations": []}
    for k, layer in enumerate(layers):
        suffix = str(k + 1) if k else ""
        traces += [
            trace | {"subplot": f"polar{suffix}", "showlegend": k == 0 and "name" in trace}
            for trace in _traces(residuals, circle, layer, layers)
        ]
        left, right = k / len(layers), (k + 0.88) / len(layers)
        layout[f"polar{suffix}"] = _polar(circle, layer, layers) | {"domain": {"x": [left, right], "y": [0.14, 1.0]}}
        words = {"text": "<br>".join(_words(circle, layer, layers)), "showarrow": False, "font": {"size": 11}}
        place = {"x": (left + right) / 2.0, "y": 0.06, "xanchor": "center", "yanchor": "top"}
        layout["annotations"].append(words | place | {"xref": "paper", "yref": "paper"})
    size = {"width": 400 * len(layers), "height": 560, "margin": {"t": 90, "b": 70}}
    return alone(Drawing(traces, layout), f"Circular test, {_name(circle)}", **size)


def _layers(causes: bool) -> tuple[Layer, ...]:
    return ("measured", "before", "after") if causes else ("measured", "before")


def _traces(residuals: Residuals, circle: Circle, layer: Layer, layers: Sequence[Layer]) -> list[dict[str, Any]]:
    factor, unit, _ = _scale(circle, layer, layers)
    zero = {"r": np.zeros_like(ROUND), "theta": ROUND, "line": {"color": ZERO, "width": 1.4}, "hoverinfo": "skip"}
    traces: list[dict[str, Any]] = [zero | {"showlegend": False}]
    for k, trace in enumerate(circle.traces):
        traces.append(
            {
                "name": trace.direction,
                "theta": np.rad2deg(trace.angle),
                "r": factor * trace.deviation[layer],
                "line": {"color": COLORS[trace.direction], "width": 1.5},
                "text": residuals.names[trace.rows],
                "hovertemplate": f"%{{r:.3g}} {unit} at %{{theta:.0f}}°<br>pose %{{text}}<extra>{trace.direction}</extra>",
                # Each direction once in the legend.
                "showlegend": trace.direction not in [one.direction for one in circle.traces[:k]],
            }
        )
    return [{"type": "scatterpolar", "mode": "lines"} | trace for trace in traces]


def _polar(circle: Circle, layer: Layer, layers: Sequence[Layer]) -> dict[str, Any]:
    """The axes of a plot; the circle of zero deviation is at two thirds of the plot's radius."""
    _, _, top = _scale(circle, layer, layers)
    step = round_below(top / 2.0)  # the largest deviation has two to five steps
    first, last = (-np.floor(INSIDE * top / step), np.floor(OUTSIDE * top / step))
    one, two = circle.axes
    grid = {"gridcolor": LINE, "linecolor": LINE}
    radial = {
        "range": [-INSIDE * top, OUTSIDE * top],
        "tickvals": step * np.arange(first, last + 1.0),
        "showticklabels": False,
        "ticks": "",
        "showline": False,
    }
    names = [f"+{one}", f"+{two}", f"−{one}", f"−{two}"]
    around = {"tickvals": [0, 90, 180, 270], "ticktext": [escaped(name) for name in names]}
    return {"bgcolor": LIGHT["paper"], "radialaxis": radial | grid, "angularaxis": around | grid}


def _name(circle: Circle) -> str:
    """A circle in words: ``ballbar XY, radius 150 mm``."""
    ids = "".join(f", {what} {one}" for what, one in (("station", circle.station), ("target", circle.target)) if one)
    return typeset(f"{circle.instrument} {circle.plane}{ids}, radius {quantity(circle.radius, 'm')}")


def _words(circle: Circle, layer: Layer, layers: Sequence[Layer]) -> list[str]:
    """The size of a division of a layer's plot, and its quantities of ISO 230-4, of each direction and of both together."""
    _, unit, top = _scale(circle, layer, layers)
    words = [f"{LAYERS[layer]}, {round_below(top / 2.0):g} {unit} a division"]
    for direction in circle.directions:
        low, high = (f"{'+' if value > 0.0 else ''}{quantity(value, 'm')}" for value in circle.radial(layer, direction))
        words.append(
            f"{direction.capitalize()}: G {quantity(circle.circular(layer, direction), 'm')}, F {low} to {high}"
        )
    if len(circle.directions) > 1:
        words.append(f"Both: G(b) {quantity(circle.circular(layer), 'm')}")
    return words


def _scale(circle: Circle, layer: Layer, layers: Sequence[Layer]) -> tuple[float, str, float]:
    """Factor from m to the unit of a layer's plot, the unit, and the largest deviation in this unit; ``before`` and ``after``
    have one scale, because they are compared."""
    alike = [one for one in layers if (one == "measured") == (layer == "measured")]
    values = np.concatenate([t.deviation[one] for t in circle.traces for one in alike])
    factor, unit = scale_of(values, "m")
    return factor, unit, factor * max(float(np.abs(values).max()), 1e-12)
