"""Maps of readings: the TCP's position at each reading, coloured by the reading's residual over its sigma."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.errors import GtpinError
from gtpin.report.embedded import Choice, Plot
from gtpin.report.figure import Drawing, alone
from gtpin.report.maps import Maps, residual_map
from gtpin.report.palette import SCALE, ZERO
from gtpin.report.poses import VIEWS
from gtpin.report.residual_plots import shown
from gtpin.report.residuals import Residuals
from gtpin.typing import Floats

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


ALL = "all"
"""The option of all instruments together."""
LEAST = 3.0
"""Smallest value at the end of the colour scale, in sigmas: noise alone exceeds it in one of 370 readings."""


def reading_maps(residuals: Residuals, layers: Choice) -> Maps:
    """Map the readings' errors without and with the causes."""
    names = [one.name for one in residuals.readings.instruments] if residuals.readings else []
    instrument = Choice("instrument", "Instrument", ((ALL, "all"), *((name, name) for name in names)))
    several = len(names) > 1
    top = _top(residuals)

    def plot(view: str) -> Plot:
        def draw(layer: str, instrument: str = ALL) -> Drawing:
            return _map(residuals, view, top, layer == "after", instrument)

        title = f"Errors of readings, {view[0]} and {view[1]}"
        return Plot(f"map-{view}", title, draw, (layers, instrument) if several else (layers,), height=310)

    return Maps(tuple(map(plot, VIEWS)), f"{top:.3g}", "sigma", instrument=instrument if several else None)


def workspace_figure(residuals: Residuals, view: str = "xy", *, after: bool = False) -> Figure:
    """Position residuals over the workspace, as :func:`~gtpin.report.maps.residual_map`; for readings, residuals over sigma.

    Parameters
    ----------
    view
        The two axes of the map: ``xy``, ``xz`` or ``yz``.
    after
        True: residuals of geometry with the causes; False: of geometry alone.
    """
    if residuals.of_poses:
        return residual_map(residuals, view, after=after)
    if view not in VIEWS:
        raise GtpinError(f"there is no view {view!r}", hint=f"give one of {', '.join(VIEWS)}")
    made = _map(residuals, view, _top(residuals), after, ALL).figure()
    bar = {"thickness": 9, "outlinewidth": 0, "title": {"text": "sigmas", "side": "right"}}
    made.update_traces(marker={"showscale": True, "colorbar": bar})
    return alone(made, "Errors of readings over their sigma")


def whitened(residuals: Residuals, after: bool) -> Floats:
    """(N,) root mean square of each row's residuals over their sigmas."""
    left = (residuals.after if after else residuals.before) / residuals.sigma
    return np.asarray(np.sqrt((left**2).mean(axis=1)))


def _top(residuals: Residuals) -> float:
    return max(LEAST, float(np.quantile(whitened(residuals, False), 0.98)))


def _map(residuals: Residuals, view: str, top: float, after: bool, instrument: str) -> Drawing:
    assert residuals.readings is not None
    names = [one.name for one in residuals.readings.instruments]
    of = residuals.readings.rows.of
    mine = np.arange(len(residuals)) if instrument == ALL else np.flatnonzero(of == names.index(instrument))
    rows = mine[shown(len(mine))]
    x, y = view[0], view[1]
    T = residuals.poses.T[rows]
    said = residuals.names[rows]
    if len(names) > 1:
        said = np.array([f"{words}, {names[i]}" for words, i in zip(said, of[rows], strict=True)], dtype=object)
    points: dict[str, Any] = {
        "x": T[:, "xyz".index(x)],
        "y": T[:, "xyz".index(y)],
        "type": "scatter",
        "mode": "markers",
        "marker": {
            "size": 6,
            "line": {"color": ZERO, "width": 0.5},
            "colorscale": SCALE,
            "cmin": 0,
            "cmax": top,
            "color": whitened(residuals, after)[rows],
        },
        "text": said,
        "hovertemplate": "pose %{text}: %{marker.color:.3g} sigma<extra></extra>",
    }
    layout = {
        "xaxis": {"title": {"text": f"{x} (m)"}, "constrain": "domain"},
        "yaxis": {"title": {"text": f"{y} (m)"}, "scaleanchor": "x", "constrain": "domain"},
        "showlegend": False,
        "margin": {"t": 10},
    }
    return Drawing([points], layout)
