"""Residual maps: lengths and directions of the position residuals over the workspace."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gtpin.errors import GtpinError
from gtpin.report.embedded import Choice, Plot
from gtpin.report.figure import Drawing, alone
from gtpin.report.palette import SCALE, ZERO
from gtpin.report.poses import VIEWS
from gtpin.report.residual_columns import scale_of
from gtpin.report.residual_plots import shown
from gtpin.report.residuals import Residuals
from gtpin.typing import Floats

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True)
class MapScale:
    """Common scales of all maps of a dataset.

    Parameters
    ----------
    factor, unit
        Factor from m to the unit of the colours, and this unit.
    top
        Length, in that unit, at the end of the colour scale.
    magnified
        Magnification of the drawn residuals.
    """

    factor: float
    unit: str
    top: float
    magnified: float

    @staticmethod
    def of(residuals: Residuals) -> MapScale:
        """Scales for the residuals of geometry alone."""
        rows = shown(len(residuals))
        length = np.linalg.norm(residuals.before[rows, :3], axis=1)
        factor, unit = scale_of(length, "m")
        top = factor * float(np.quantile(length, 0.98))
        return MapScale(factor, unit, top, _magnification(residuals.poses.T[rows], length))


@dataclass(frozen=True)
class Maps:
    """Maps of each pair of axes, with the value at the end of the colour scale and its unit.

    Parameters
    ----------
    magnified
        Magnification of drawn directions; "" where none are drawn.
    instrument
        Choice of an instrument; None where there is only one.
    """

    plots: tuple[Plot, ...]
    top: str
    unit: str
    magnified: str = ""
    instrument: Choice | None = None


def maps(residuals: Residuals, layers: Choice) -> Maps:
    """Map the residuals without and with the causes."""
    scale = MapScale.of(residuals)

    def plot(view: str) -> Plot:
        def draw(layer: str) -> Drawing:
            return _map(residuals, view, scale, layer == "after")

        return Plot(f"map-{view}", f"Residual map, {view[0]} and {view[1]}", draw, (layers,), height=310)

    return Maps(tuple(map(plot, VIEWS)), f"{scale.top:.3g}", scale.unit, f"{scale.magnified:,.0f}")


def residual_map(residuals: Residuals, view: str = "xy", *, after: bool = False) -> Figure:
    """Position residuals over the workspace, base frame: colours show their lengths, lines their directions.

    Parameters
    ----------
    view
        The two axes of the map: ``xy``, ``xz`` or ``yz``.
    after
        True: residuals of geometry with the causes; False: of geometry alone.
    """
    if view not in VIEWS:
        raise GtpinError(f"there is no view {view!r}", hint=f"give one of {', '.join(VIEWS)}")
    scale = MapScale.of(residuals)
    made = _map(residuals, view, scale, after).figure()
    bar = {"thickness": 9, "outlinewidth": 0, "title": {"text": scale.unit, "side": "right"}}
    made.update_traces(selector={"mode": "markers"}, marker={"showscale": True, "colorbar": bar})
    return alone(made, f"Position residuals, directions magnified {scale.magnified:,.0f} times")


def _magnification(T: Floats, lengths: Floats) -> float:
    """A round factor with which the median residual is drawn as at most a fifteenth of the workspace."""
    usual = max(float(np.median(lengths)), 1e-12)
    wanted = max(float(np.ptp(T, axis=0).max()) / 15.0 / usual, 1.0)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def _map(residuals: Residuals, view: str, scale: MapScale, after: bool) -> Drawing:
    rows = shown(len(residuals))
    T = residuals.poses.T[rows]
    # Residuals are in the instrument's frame, the map is in the base frame.
    left = (residuals.after if after else residuals.before)[rows, :3] @ residuals.model.frame.R
    ends = T + scale.magnified * left
    x, y = view[0], view[1]
    a, b = "xyz".index(x), "xyz".index(y)
    gap = np.full(len(T), np.nan)
    arrows = {
        "x": np.stack([T[:, a], ends[:, a], gap], axis=1).ravel(),
        "y": np.stack([T[:, b], ends[:, b], gap], axis=1).ravel(),
        "type": "scatter",
        "mode": "lines",
        "line": {"color": ZERO, "width": 1.2},
        "hoverinfo": "skip",
        "connectgaps": False,
    }
    length = scale.factor * np.linalg.norm(left, axis=1)
    points = {
        "x": T[:, a],
        "y": T[:, b],
        "type": "scatter",
        "mode": "markers",
        "marker": {
            "size": 6,
            "line": {"color": ZERO, "width": 0.5},
            "colorscale": SCALE,
            "cmin": 0,
            "cmax": scale.top,
            "color": length,
        },
        "text": residuals.names[rows],
        "hovertemplate": f"pose %{{text}}: %{{marker.color:.3g}} {scale.unit}<extra></extra>",
    }
    layout = {
        "xaxis": {"title": {"text": f"{x} (m)"}, "constrain": "domain"},
        "yaxis": {"title": {"text": f"{y} (m)"}, "scaleanchor": "x", "constrain": "domain"},
        "showlegend": False,
        "margin": {"t": 10},
    }
    return Drawing([arrows, points], layout)
