"""Residual maps: lengths and directions of the position residuals over the workspace."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gtpin.report.dataset import VIEWS, map_layout, map_points
from gtpin.report.embedded import Plot, PlotChoice
from gtpin.report.figure import SCALE, ZERO, Drawing, alone, colorbar, round_below, scatter
from gtpin.report.residual_plots import scale_of, shown
from gtpin.report.residuals import Residuals
from gtpin.typing import Floats

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


ALL = "all"
"""The option of all instruments together."""
LEAST = 3.0
"""Smallest value at the end of the colour scale of readings, in sigmas: noise alone exceeds it in one of 370 readings."""


@dataclass(frozen=True)
class MapScale:
    """Common scales of all maps of a dataset.

    ``factor``, ``unit``: factor to the unit of the colours, from m or from sigmas, and this unit. ``top``: size, in that
    unit, at the end of the colour scale. ``magnified``: magnification of the drawn residuals; 0 where no directions are
    drawn.
    """

    factor: float
    unit: str
    top: float
    magnified: float = 0.0

    @staticmethod
    def of(residuals: Residuals) -> MapScale:
        """Scales for the residuals of geometry alone; the median one is drawn as at most a fifteenth of the workspace."""
        if not residuals.of_poses:
            return MapScale(1.0, "sigma", max(LEAST, float(np.quantile(sizes(residuals, False), 0.98))))
        rows = shown(len(residuals))
        length, T = sizes(residuals, False)[rows], residuals.poses.T[rows]
        factor, unit = scale_of(length, "m")
        wanted = float(np.ptp(T, axis=0).max()) / 15.0 / max(float(np.median(length)), 1e-12)
        return MapScale(factor, unit, factor * float(np.quantile(length, 0.98)), round_below(max(wanted, 1.0)))


def sizes(residuals: Residuals, after: bool) -> Floats:
    """(N,) lengths of the position residuals, m; for readings, root mean squares of each row's residuals over their sigmas."""
    residual = residuals.after if after else residuals.before
    if residuals.of_poses:
        return np.asarray(np.linalg.norm(residual[:, :3], axis=1))
    return np.asarray(np.sqrt(((residual / residuals.sigma) ** 2).mean(axis=1)))


def maps(residuals: Residuals, scale: MapScale, layers: PlotChoice) -> tuple[list[Plot], tuple[PlotChoice, ...]]:
    """Maps of each pair of axes without and with the causes, and what the reader can choose: the layer, and of several
    instruments one."""
    names = [one.name for one in residuals.readings.instruments]
    choice = PlotChoice("instrument", "Instrument", ((ALL, "all"), *((name, name) for name in names)))
    choices = (layers, choice) if len(names) > 1 else (layers,)
    what = "Residual map" if residuals.of_poses else "Errors of readings"

    def plot(view: str) -> Plot:
        def draw(layer: str, instrument: str = ALL) -> Drawing:
            return _map(residuals, view, scale, layer == "after", instrument)

        return Plot(f"map-{view}", f"{what}, {view[0]} and {view[1]}", draw, choices, height=310)

    return [plot(view) for view in VIEWS], choices


def workspace_figure(residuals: Residuals, view: str = "xy", *, after: bool = False) -> Figure:
    """Residuals over the workspace, base frame: colours show the lengths of position residuals, lines their directions.

    For readings, colours show the residuals over their sigmas. ``after``: as in :func:`residual_figure`.
    """
    scale = MapScale.of(residuals)
    title = "Errors of readings over their sigma"
    if residuals.of_poses:
        title = f"Position residuals, directions magnified {scale.magnified:,.0f} times"
    return alone(_map(residuals, view, scale, after), title)


def _map(residuals: Residuals, view: str, scale: MapScale, after: bool, instrument: str = ALL) -> Drawing:
    names, of = [one.name for one in residuals.readings.instruments], residuals.readings.rows.of
    mine = np.arange(len(residuals)) if instrument == ALL else np.flatnonzero(of == names.index(instrument))
    rows = mine[shown(len(mine))]
    T = residuals.poses.T[rows]
    said = residuals.names[rows]
    if len(names) > 1:
        said = np.array([f"{words}, {names[i]}" for words, i in zip(said, of[rows], strict=True)], dtype=object)
    marker = {"colorscale": SCALE, "cmin": 0, "cmax": scale.top, "color": scale.factor * sizes(residuals, after)[rows]}
    marker |= {"showscale": True, "colorbar": colorbar(scale.unit)}
    hover = f"pose %{{text}}: %{{marker.color:.3g}} {scale.unit}<extra></extra>"
    traces = [map_points(T, view, said, hover, marker)]
    if scale.magnified:
        # Residuals are in the instrument's frame, the map is in the base frame.
        residual = (residuals.after if after else residuals.before)[rows, :3] @ residuals.model.frame.R
        ends, gap = T + scale.magnified * residual, np.full(len(T), np.nan)
        x, y = (np.stack([T[:, k], ends[:, k], gap], axis=1).ravel() for k in map("xyz".index, view))
        look = {"color": ZERO, "width": 1.2}
        traces.insert(0, scatter("lines", x, y, line=look, hoverinfo="skip", connectgaps=False))
    return Drawing(traces, map_layout(T, view, showlegend=False, margin={"t": 10}))
