"""Positions over the workspace."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from gtpin.errors import GtpinError
from gtpin.report.embedded import escaped
from gtpin.report.figure import Drawing, alone
from gtpin.report.palette import DATA, LIGHT, SCALE

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

VIEWS = ("xy", "xz", "yz")
"""Pairs of axes of a map of positions."""


def position_map(
    T: npt.NDArray[np.float64],
    names: Sequence[object],
    view: str,
    title: str,
    color: npt.NDArray[np.float64] | None = None,
    color_title: str = "",
) -> Figure:
    """A map of positions (N, 3), m, over two of their axes.

    Parameters
    ----------
    names
        (N,) names of the poses.
    view
        The two axes: ``xy``, ``xz`` or ``yz``.
    color
        (N,) values that determine the colours.
    """
    if view not in VIEWS:
        raise GtpinError(f"there is no view {view!r}", hint=f"give one of {', '.join(VIEWS)}")
    marker = {"size": 6, "color": DATA, "line": {"color": LIGHT["zero"], "width": 0.5}}
    if color is not None:
        bar = {"thickness": 9, "outlinewidth": 0, "title": {"text": color_title, "side": "right"}}
        marker |= {"color": color, "colorscale": SCALE, "showscale": True, "colorbar": bar}
    trace = {
        "type": "scatter",
        "mode": "markers",
        "x": T[:, "xyz".index(view[0])],
        "y": T[:, "xyz".index(view[1])],
        "text": [escaped(str(name)) for name in names],
        "hovertemplate": "pose %{text}: %{x:.4f} m, %{y:.4f} m<extra></extra>",
        "marker": marker,
    }
    layout = {
        "xaxis": {"title": {"text": f"{view[0]} (m)"}},
        "yaxis": {"title": {"text": f"{view[1]} (m)"}, "scaleanchor": "x"},
    }
    return alone(Drawing([trace], layout).figure(), title)
