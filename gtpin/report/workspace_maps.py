"""Slices of the workspace, coloured by expected errors, condition number or distance from singularity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.accuracy.analysis import Accuracy
from gtpin.accuracy.figures import UNITS
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

    return choice, [plot(number, layer) for number, layer in enumerate(found.space.layers)]


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
    layers, space = found.space.layers, found.space
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
    """The maps by name: (M,) values at the reachable points, and their unit."""
    relative = {"home": "as at home: 1", "best": "best posture: 1"}[found.space.dexterity.one_at]
    units = {"condition number": "", "distance from singularity": relative}
    values: dict[str, tuple[Floats, str]] = {}
    for name, at in found.maps.items():
        if name in UNITS:
            factor, units[name] = scale_of(at, UNITS[name])
            at = factor * at
        values[name] = (at, units[name])
    return values


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
