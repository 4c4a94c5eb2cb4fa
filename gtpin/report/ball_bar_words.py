"""Circular tests in words, with the quantities of ISO 230-4, and the scale of their plots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.report.ball_bar import Circle, Layer
from gtpin.report.residual_columns import scale_of
from gtpin.report.words import quantity, typeset

LAYERS: dict[Layer, str] = {
    "measured": "As measured",
    "before": "Left by geometry alone",
    "after": "Left by geometry with the causes",
}


def name_of(circle: Circle) -> str:
    """A circle in words: ``ballbar XY, radius 150 mm``."""
    ids = "".join(f", {what} {one}" for what, one in (("station", circle.station), ("target", circle.target)) if one)
    return typeset(f"{circle.instrument} {circle.plane}{ids}, radius {quantity(circle.radius, 'm')}")


def caption(circle: Circle, layer: Layer, layers: Sequence[Layer]) -> str:
    """The quantities of ISO 230-4 of a layer, and the size of a division of its plot."""
    first, *others = lines(circle, layer, layers)
    return f"{first}. {'. '.join(others)}."


def lines(circle: Circle, layer: Layer, layers: Sequence[Layer]) -> list[str]:
    """The same as lines: the division, the quantities of each direction, and those of both together."""
    _, unit, top = scale(circle, one_scale(layer, layers))
    words = [f"{LAYERS[layer]}, {division(top):g} {unit} a division"]
    for direction in circle.directions:
        low, high = (f"{'+' if value > 0.0 else ''}{quantity(value, 'm')}" for value in circle.radial(layer, direction))
        words.append(
            f"{direction.capitalize()}: G {quantity(circle.circular(layer, direction), 'm')}, F {low} to {high}"
        )
    if len(circle.directions) > 1:
        words.append(f"Both: G(b) {quantity(circle.circular(layer), 'm')}")
    return words


def scale(circle: Circle, layers: Sequence[Layer]) -> tuple[float, str, float]:
    """Factor from m to the unit of a plot of some layers, the unit, and their largest deviation in this unit."""
    values = np.concatenate([t.deviation[layer] for t in circle.traces for layer in layers])
    factor, unit = scale_of(values, "m")
    return factor, unit, factor * max(float(np.abs(values).max()), 1e-12)


def one_scale(layer: Layer, layers: Sequence[Layer]) -> Sequence[Layer]:
    """The layers with the same scale as ``layer``: ``before`` and ``after`` have one scale, because they are compared."""
    return [one for one in layers if (one == "measured") == (layer == "measured")]


def division(top: float) -> float:
    """Step of a plot's divisions: 1, 2 or 5 times a power of ten, so that the largest deviation has two to five steps."""
    power = 10.0 ** np.floor(np.log10(top / 2.0))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= top / 2.0))
