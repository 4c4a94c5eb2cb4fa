"""Residual maps: lengths and directions of the position residuals over the workspace."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.report.page import Plot
from gtpin.report.residual_plots import scale_of, shown
from gtpin.report.residuals import Residuals

Floats = npt.NDArray[np.float64]

VIEWS = ((0, 1), (0, 2), (1, 2))
"""Pairs of axes that maps are seen along."""


@dataclass(frozen=True)
class Maps:
    """Maps seen along each axis, their columns, and what they share: top of the colours, its unit, magnification."""

    plots: tuple[Plot, ...]
    columns: dict[str, Any]
    top: str
    unit: str
    magnified: str


def maps(residuals: Residuals) -> Maps:
    """Map what is left before and after the causes (columns ``before`` and ``after``)."""
    rows = shown(len(residuals))
    T = residuals.poses.T[rows]
    R = residuals.model.frame.R  # residuals are the instrument's, the map the base frame's
    before, after = (values[rows, :3] @ R for values in (residuals.before, residuals.after))
    lengths = np.linalg.norm(np.stack([before, after]), axis=2)
    factor, unit = scale_of(lengths[0], "m")
    magnified = _magnification(T, lengths[0])
    columns: dict[str, Any] = {f"tcp {'xyz'[k]}": T[:, k] for k in range(3)}
    for name, values, size in (("before", before, lengths[0]), ("after", after, lengths[1])):
        columns[f"size {name}"] = factor * size
        ends = T + magnified * values
        for k in range(3):
            columns[f"{name} {'xyz'[k]} arrow"] = np.stack(
                [T[:, k], ends[:, k], np.full(len(T), np.nan)], axis=1
            ).ravel()
    top = factor * float(np.quantile(lengths[0], 0.98))
    return Maps(tuple(_map(a, b, top, unit) for a, b in VIEWS), columns, f"{top:.3g}", unit, f"{magnified:,.0f}")


def _magnification(T: Floats, lengths: Floats) -> float:
    """A round factor that makes the usual residual a fifteenth of the workspace."""
    usual = max(float(np.median(lengths)), 1e-12)
    wanted = max(float(np.ptp(T, axis=0).max()) / 15.0 / usual, 1.0)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def _map(a: int, b: int, top: float, unit: str) -> Plot:
    x, y = "xyz"[a], "xyz"[b]
    arrows = {
        "x": f"#{{layer}} {x} arrow",
        "y": f"#{{layer}} {y} arrow",
        "type": "scatter",
        "mode": "lines",
        "line": {"color": "@zero", "width": 1.2},
        "hoverinfo": "skip",
        "connectgaps": False,
    }
    color = {
        "colorscale": [[0, "@low"], [0.45, "@mid"], [1, "@high"]],
        "cmin": 0,
        "cmax": top,
        "color": "#size {layer}",
    }
    points = {
        "x": f"#tcp {x}",
        "y": f"#tcp {y}",
        "type": "scatter",
        "mode": "markers",
        "marker": {"size": 6, "line": {"color": "@zero", "width": 0.5}} | color,
        "text": "#pose",
        "hovertemplate": f"pose %{{text}}: %{{marker.color:.3g}} {unit}<extra></extra>",
    }
    layout = {
        "xaxis": {"title": {"text": f"{x} (m)"}, "constrain": "domain"},
        "yaxis": {"title": {"text": f"{y} (m)"}, "scaleanchor": "x", "constrain": "domain"},
        "showlegend": False,
        "margin": {"t": 10},
    }
    return Plot(f"map-{x}{y}", f"Residual map, {x} and {y}", [arrows, points], layout, height=310)
