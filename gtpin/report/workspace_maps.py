"""Slices of the workspace, coloured by what to expect there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.analysis import Accuracy
from gtpin.accuracy.expected import mean_length, response
from gtpin.errors import ModelError
from gtpin.report.embedded import Choice, Plot
from gtpin.report.figure import alone, figure
from gtpin.report.palette import SCALE
from gtpin.report.residual_columns import scale_of
from gtpin.report.words import typeset

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

Floats = npt.NDArray[np.float64]

SLICES = 3
"""Slices of the workspace that are shown."""


def slices(found: Accuracy) -> tuple[Choice, list[Plot]]:
    """Slices orthogonal to the base frame's x, and what the reader can colour them by."""
    values = _quantities(found)
    options = tuple((name, _label(name, unit)) for name, (_, unit) in values.items())
    choice = Choice("quantity", "Coloured by", options)

    def plot(number: int, layer: int) -> Plot:
        def draw(quantity: str) -> Figure:
            return figure([_slice(found, values[quantity][0], layer)], _layout())

        title = f"x = {found.space.axes[0][layer]:.2f} m"
        return Plot(f"slice-{number}", f"Slice of the workspace at {title}", draw, (choice,), title, 300)

    return choice, [plot(number, layer) for number, layer in enumerate(_layers(found))]


def workspace_map(found: Accuracy, quantity: str = "position error") -> Figure:
    """Slices of the workspace side by side, orthogonal to the base frame's x; blank where the robot can't go.

    Parameters
    ----------
    quantity
        ``position error``, ``orientation error``, ``condition number`` or ``distance from singularity``.

    Raises
    ------
    ModelError
        If there is no such quantity; a reduced arm has no orientation error.
    """
    values = _quantities(found)
    if quantity not in values:
        raise ModelError(f"there is no map of {quantity!r}", hint=f"give one of {', '.join(values)}")
    at, unit = values[quantity]
    layers = _layers(found)
    bar = {"title": {"text": _label(quantity, unit), "side": "right"}}
    traces, layout = [], {}
    for k, layer in enumerate(layers):
        suffix = str(k + 1) if k else ""
        trace = _slice(found, at, layer) | {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}", "showscale": k == 0}
        traces.append(trace | {"colorbar": trace["colorbar"] | bar})
        own = _layout()
        own["yaxis"]["scaleanchor"] = f"x{suffix}"
        domain = [k / len(layers), (k + 0.8) / len(layers)]
        title = typeset(f"y (m), at x = {found.space.axes[0][layer]:.2f} m")
        layout[f"xaxis{suffix}"] = own["xaxis"] | {"domain": domain, "title": {"text": title}, "anchor": f"y{suffix}"}
        layout[f"yaxis{suffix}"] = own["yaxis"] | {"anchor": f"x{suffix}", "title": {"text": "" if k else "z (m)"}}
    return alone(figure(traces, layout), f"{quantity.capitalize()} over the workspace")


def _label(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name


def _quantities(found: Accuracy) -> dict[str, tuple[Floats, str]]:
    """(M,) values at the reachable points, and their units, by name."""
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
    values["distance from singularity"] = (space.dexterity.singularity, "as at home: 1")
    return values


def _layers(found: Accuracy) -> list[int]:
    """Indices along x of the slices: the middles of as many parts."""
    there = np.flatnonzero(found.space.reachable.any(axis=(1, 2)))
    count = min(SLICES, len(there))
    return [int(there[(2 * i + 1) * len(there) // (2 * count)]) for i in range(count)]


def _slice(found: Accuracy, at: Floats, layer: int) -> dict[str, Any]:
    _, y, z = found.space.axes
    finite = at[np.isfinite(at)]
    return {
        "type": "heatmap",
        "x": y,
        "y": z,
        "z": found.space.on_grid(at)[layer].T,
        "zmin": float(finite.min()),
        "zmax": float(finite.max()),
        "colorscale": SCALE,
        "colorbar": {"thickness": 9, "outlinewidth": 0},
        "hovertemplate": "y %{x:.3f} m, z %{y:.3f} m: %{z:.3g}<extra></extra>",
    }


def _layout() -> dict[str, Any]:
    return {
        "xaxis": {"title": {"text": "y (m)"}, "constrain": "domain"},
        "yaxis": {"title": {"text": "z (m)"}, "scaleanchor": "x", "constrain": "domain"},
        "margin": {"t": 10},
    }
