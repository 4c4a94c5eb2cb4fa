"""Residual maps: lengths and directions of the position residuals over the workspace."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gtpin.errors import GtpinError
from gtpin.report.embedded import Plot, PlotChoice
from gtpin.report.figure import Drawing, alone, scatter
from gtpin.report.palette import SCALE, ZERO
from gtpin.report.poses import VIEWS, map_layout
from gtpin.report.residual_columns import scale_of
from gtpin.report.residual_plots import shown
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
        """Scales for the residuals of geometry alone."""
        if not residuals.of_poses:
            return MapScale(1.0, "sigma", max(LEAST, float(np.quantile(sizes(residuals, False), 0.98))))
        rows = shown(len(residuals))
        length = sizes(residuals, False)[rows]
        factor, unit = scale_of(length, "m")
        top = factor * float(np.quantile(length, 0.98))
        return MapScale(factor, unit, top, _magnification(residuals.poses.T[rows], length))


@dataclass(frozen=True)
class Maps:
    """Maps of each pair of axes, with the value at the end of the colour scale and its unit.

    ``magnified``: magnification of drawn directions; "" where none are drawn. ``instrument``: choice of an instrument; None
    where there is only one.
    """

    plots: tuple[Plot, ...]
    top: str
    unit: str
    magnified: str = ""
    instrument: PlotChoice | None = None


def sizes(residuals: Residuals, after: bool) -> Floats:
    """(N,) lengths of the position residuals, m; for readings, root mean squares of each row's residuals over their sigmas."""
    left = residuals.after if after else residuals.before
    if residuals.of_poses:
        return np.asarray(np.linalg.norm(left[:, :3], axis=1))
    return np.asarray(np.sqrt(((left / residuals.sigma) ** 2).mean(axis=1)))


def maps(residuals: Residuals, layers: PlotChoice) -> Maps:
    """Map the residuals without and with the causes."""
    scale, names = MapScale.of(residuals), [one.name for one in residuals.readings.instruments]
    choice = PlotChoice("instrument", "Instrument", ((ALL, "all"), *((name, name) for name in names)))
    instrument = choice if len(names) > 1 else None
    what = "Residual map" if residuals.of_poses else "Errors of readings"

    def plot(view: str) -> Plot:
        def draw(layer: str, instrument: str = ALL) -> Drawing:
            return _map(residuals, view, scale, layer == "after", instrument)

        choices = (layers,) if instrument is None else (layers, instrument)
        return Plot(f"map-{view}", f"{what}, {view[0]} and {view[1]}", draw, choices, height=310)

    magnified = f"{scale.magnified:,.0f}" if scale.magnified else ""
    return Maps(tuple(map(plot, VIEWS)), f"{scale.top:.3g}", scale.unit, magnified, instrument)


def workspace_figure(residuals: Residuals, view: str = "xy", *, after: bool = False) -> Figure:
    """Residuals over the workspace, base frame: colours show the lengths of position residuals, lines their directions.

    For readings, colours show the residuals over their sigmas.

    ``view``: the two axes of the map: ``xy``, ``xz`` or ``yz``. ``after``: True: residuals of geometry with the causes;
    False: of geometry alone.
    """
    if view not in VIEWS:
        raise GtpinError(f"there is no view {view!r}", hint=f"give one of {', '.join(VIEWS)}")
    scale = MapScale.of(residuals)
    made = _map(residuals, view, scale, after).figure()
    unit = scale.unit if residuals.of_poses else "sigmas"
    bar = {"thickness": 9, "outlinewidth": 0, "title": {"text": unit, "side": "right"}}
    made.update_traces(selector={"mode": "markers"}, marker={"showscale": True, "colorbar": bar})
    if residuals.of_poses:
        return alone(made, f"Position residuals, directions magnified {scale.magnified:,.0f} times")
    return alone(made, "Errors of readings over their sigma")


def _magnification(T: Floats, lengths: Floats) -> float:
    """A round factor with which the median residual is drawn as at most a fifteenth of the workspace."""
    usual = max(float(np.median(lengths)), 1e-12)
    wanted = max(float(np.ptp(T, axis=0).max()) / 15.0 / usual, 1.0)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def _map(residuals: Residuals, view: str, scale: MapScale, after: bool, instrument: str = ALL) -> Drawing:
    names, of = [one.name for one in residuals.readings.instruments], residuals.readings.rows.of
    mine = np.arange(len(residuals)) if instrument == ALL else np.flatnonzero(of == names.index(instrument))
    rows = mine[shown(len(mine))]
    T = residuals.poses.T[rows]
    a, b = "xyz".index(view[0]), "xyz".index(view[1])
    said = residuals.names[rows]
    if len(names) > 1:
        said = np.array([f"{words}, {names[i]}" for words, i in zip(said, of[rows], strict=True)], dtype=object)
    marker = {
        "size": 6,
        "line": {"color": ZERO, "width": 0.5},
        "colorscale": SCALE,
        "cmin": 0,
        "cmax": scale.top,
        "color": scale.factor * sizes(residuals, after)[rows],
    }
    hover = f"pose %{{text}}: %{{marker.color:.3g}} {scale.unit}<extra></extra>"
    traces = [scatter("markers", T[:, a], T[:, b], marker=marker, text=said, hovertemplate=hover)]
    if scale.magnified:
        # Residuals are in the instrument's frame, the map is in the base frame.
        left = (residuals.after if after else residuals.before)[rows, :3] @ residuals.model.frame.R
        ends, gap = T + scale.magnified * left, np.full(len(T), np.nan)
        x, y = (np.stack([T[:, k], ends[:, k], gap], axis=1).ravel() for k in (a, b))
        look = {"color": ZERO, "width": 1.2}
        traces.insert(0, scatter("lines", x, y, line=look, hoverinfo="skip", connectgaps=False))
    return Drawing(traces, map_layout(T, view, showlegend=False, margin={"t": 10}))
