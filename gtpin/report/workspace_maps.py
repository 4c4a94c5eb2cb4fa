"""Slices of the workspace, coloured by expected errors, condition number or distance from singularity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.accuracy.analysis import Accuracy
from gtpin.accuracy.expected import mean_length, response
from gtpin.accuracy.workspace import Workspace
from gtpin.errors import ModelError
from gtpin.report.embedded import Plot, PlotChoice
from gtpin.report.figure import Drawing, alone
from gtpin.report.palette import SCALE
from gtpin.report.residual_columns import scale_of
from gtpin.report.words import typeset
from gtpin.typing import Floats

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


SLICES = 3
"""Largest number of slices that are shown."""


def slices(found: Accuracy) -> tuple[PlotChoice, list[Plot]]:
    """The choice of the quantity that determines the colours, and the slices, orthogonal to an axis of the base frame."""
    values, space = _quantities(found), found.space
    options = tuple((name, _label(name, unit)) for name, (_, unit) in values.items())
    choice = PlotChoice("quantity", "Coloured by", options)

    def plot(number: int, layer: int) -> Plot:
        def draw(quantity: str) -> Drawing:
            return Drawing([_slice(found, values[quantity][0], layer)], _layout(space))

        title = _place(space, layer)
        return Plot(f"slice-{number}", f"Slice of the workspace at {title}", draw, (choice,), title, 300)

    return choice, [plot(number, layer) for number, layer in enumerate(_layers(found))]


def workspace_map(found: Accuracy, quantity: str = "position error") -> Figure:
    """Slices of the workspace side by side, orthogonal to an axis of the base frame; blank out of reach.

    ``quantity``: ``position error``, ``orientation error``, ``condition number`` or ``distance from singularity``.

    Raises `ModelError` if there is no such quantity: a reduced arm has no orientation error, and a condition number that is
    infinite everywhere has no map.
    """
    values = _quantities(found)
    if quantity not in values:
        raise ModelError(f"there is no map of {quantity!r}", hint=f"give one of {', '.join(values)}")
    at, unit = values[quantity]
    layers, space = _layers(found), found.space
    names = _names(space)
    bar = {"title": {"text": _label(quantity, unit), "side": "right"}}
    traces, layout = [], {}
    for k, layer in enumerate(layers):
        suffix = str(k + 1) if k else ""
        trace = _slice(found, at, layer) | {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}", "showscale": k == 0}
        traces.append(trace | {"colorbar": trace["colorbar"] | bar})
        own = _layout(space)
        own["yaxis"]["scaleanchor"] = f"x{suffix}"
        domain = [k / len(layers), (k + 0.8) / len(layers)]
        title = typeset(f"{names[0]} (m), at {_place(space, layer)}")
        layout[f"xaxis{suffix}"] = own["xaxis"] | {"domain": domain, "title": {"text": title}, "anchor": f"y{suffix}"}
        layout[f"yaxis{suffix}"] = own["yaxis"] | {
            "anchor": f"x{suffix}",
            "title": {"text": "" if k else f"{names[1]} (m)"},
        }
    return alone(Drawing(traces, layout).figure(), f"{quantity.capitalize()} over the workspace")


def _label(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name


def _quantities(found: Accuracy) -> dict[str, tuple[Floats, str]]:
    """By name: (M,) values at the reachable points, and their unit; without quantities that are infinite everywhere."""
    space = found.space
    covariance = response(found.model, space.q, found.uncertainty).covariance
    values: dict[str, tuple[Floats, str]] = {}
    for name, error, unit in (
        ("position error", mean_length(covariance[:, :3, :3]), "m"),
        ("orientation error", mean_length(covariance[:, 3:, 3:]), "rad"),
    ):
        if unit == "m" or not found.model.geometry.reduced:
            factor, prefixed = scale_of(error, unit)
            values[name] = (factor * error, prefixed)
    values["condition number"] = (space.dexterity.condition, "")
    relative = {"home": "as at home: 1", "best": "best posture: 1"}[space.dexterity.one_at]
    values["distance from singularity"] = (space.dexterity.singularity, relative)
    return {name: (at, unit) for name, (at, unit) in values.items() if np.isfinite(at).any()}


def _layers(found: Accuracy) -> list[int]:
    """Indices of the slices: in the middle of equal parts of the reachable workspace."""
    space = found.space
    there = np.flatnonzero(space.reachable.any(axis=tuple(i for i in range(3) if i != space.across)))
    count = min(SLICES, len(there))
    return [int(there[(2 * i + 1) * len(there) // (2 * count)]) for i in range(count)]


def _slice(found: Accuracy, at: Floats, layer: int) -> dict[str, Any]:
    space = found.space
    x, y = (space.axes["xyz".index(name)] for name in _names(space))
    a, b = _names(space)
    table = space.on_grid(at)
    finite = table[np.isfinite(table)]
    return {
        "type": "heatmap",
        "x": x,
        "y": y,
        "z": table.take(layer, axis=space.across).T,
        "zmin": float(finite.min()),
        "zmax": float(finite.max()),
        "colorscale": SCALE,
        "colorbar": {"thickness": 9, "outlinewidth": 0},
        "hovertemplate": f"{a} %{{x:.3f}} m, {b} %{{y:.3f}} m: %{{z:.3g}}<extra></extra>",
    }


def _names(space: Workspace) -> tuple[str, str]:
    """The axes of a slice."""
    a, b = (name for i, name in enumerate("xyz") if i != space.across)
    return a, b


def _place(space: Workspace, layer: int) -> str:
    return f"{'xyz'[space.across]} = {space.axes[space.across][layer]:.2f} m"


def _layout(space: Workspace) -> dict[str, Any]:
    a, b = _names(space)
    return {
        "xaxis": {"title": {"text": f"{a} (m)"}, "constrain": "domain"},
        "yaxis": {"title": {"text": f"{b} (m)"}, "scaleanchor": "x", "constrain": "domain"},
        "margin": {"t": 10},
    }
