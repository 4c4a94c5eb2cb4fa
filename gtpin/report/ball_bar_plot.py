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
    layers, found = _layers(causes), []
    for number, circle in enumerate(circles(residuals)):
        title = _name(circle)
        plots = [
            Plot(
                f"circle-{number}-{layer}",
                f"{title}: {LAYERS[layer].lower()}",
                partial(_alone, residuals, circle, layer, layers),
                caption=". ".join([*_words(circle, layer, layers), ""]).rstrip(),
                height=300,
            )
            for layer in layers
        ]
        found.append((title, plots))
    return found


def ball_bar_figure(residuals: Residuals, number: int, causes: bool) -> Figure:
    """The layers of a circle, side by side.

    ``number``: index of the circle in the data, counted from 0. ``causes``: whether there are causes: a last layer then
    shows the residuals with them.

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
        words = "<br>".join(_words(circle, layer, layers))
        place = {"x": (left + right) / 2.0, "y": 0.06, "xanchor": "center", "yanchor": "top"}
        place |= {"xref": "paper", "yref": "paper"}
        layout["annotations"].append({"text": words, "showarrow": False, "font": {"size": 11}} | place)
    layout |= {"width": 400 * len(layers), "height": 560}
    made = alone(Drawing(traces, layout).figure(), f"Circular test, {_name(circle)}")
    made.update_layout(margin={"t": 90, "b": 70})
    return made


def _layers(causes: bool) -> tuple[Layer, ...]:
    return ("measured", "before", "after") if causes else ("measured", "before")


def _alone(residuals: Residuals, circle: Circle, layer: Layer, layers: Sequence[Layer]) -> Drawing:
    layout = {
        "polar": _polar(circle, layer, layers),
        "showlegend": False,
        "margin": {"t": 24, "b": 24, "l": 30, "r": 30},
    }
    return Drawing(_traces(residuals, circle, layer, layers), layout)


def _traces(residuals: Residuals, circle: Circle, layer: Layer, layers: Sequence[Layer]) -> list[dict[str, Any]]:
    factor, unit, _ = _scale(circle, layer, layers)
    zero = {"r": np.zeros_like(ROUND), "theta": ROUND, "mode": "lines", "line": {"color": ZERO, "width": 1.4}}
    traces: list[dict[str, Any]] = [zero | {"type": "scatterpolar", "hoverinfo": "skip"}]
    for trace in circle.traces:
        told = f"%{{r:.3g}} {unit} at %{{theta:.0f}}°<br>pose %{{text}}<extra>{trace.direction}</extra>"
        traces.append(
            {
                "type": "scatterpolar",
                "mode": "lines",
                "name": trace.direction,
                "theta": np.rad2deg(trace.angle),
                "r": factor * trace.deviation[layer],
                "line": {"color": COLORS[trace.direction], "width": 1.5},
                "text": residuals.names[trace.rows],
                "hovertemplate": told,
            }
        )
    named = set[str]()
    for one in traces:  # each direction once in the legend
        one["showlegend"] = "name" in one and one["name"] not in named
        named.add(one.get("name", ""))
    return traces


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
