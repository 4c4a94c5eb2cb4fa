"""Figures of a comparison of the paper's models."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from gtpin.calibration.cart_tracks import Linearity
from gtpin.comparison.result import Comparison
from gtpin.data import CartMeasurements
from gtpin.errors import DatasetError
from gtpin.report.embedded import Choice, Plot
from gtpin.report.figure import Drawing
from gtpin.report.palette import ACCENT, FIT, GOOD, INK, SOFT, WARN
from gtpin.report.residual_plots import shown

if TYPE_CHECKING:
    pass

COLORS = {1: SOFT, 2: WARN, 3: ACCENT, 4: GOOD, 5: FIT}
FIGURES = {"mean_um": "mean", "rms_um": "root mean square", "max_um": "largest"}
ANGLES = Choice("angle", "Angle", (("alpha", "alpha"), ("beta", "beta"), ("gamma", "gamma")))
"""ZYZ Euler angles."""


def errors_plot(comparison: Comparison) -> Plot:
    """:func:`errors_drawing` as a plot of a page."""
    title = "Position errors of each model with 95 % intervals"
    return Plot("errors", title, partial(errors_drawing, comparison), height=360)


def angles_plot(comparison: Comparison) -> Plot:
    """:func:`angles_drawing` as a plot of a page."""
    return Plot("angles", "Orientation errors pose by pose", partial(angles_drawing, comparison), (ANGLES,))


def carts_plot(carts: CartMeasurements) -> Plot:
    """:func:`carts_drawing` as a plot of a page."""
    title = "What a straight line leaves of each cart's measured track"
    return Plot("carts", title, partial(carts_drawing, carts), height=320)


def errors_drawing(comparison: Comparison) -> Drawing:
    """Mean, root mean square and largest position error of each model on held-out poses, with 95 % intervals."""
    traces = []
    for held, ends in zip(comparison.held, comparison.intervals(), strict=True):
        figures = held.figures()
        values = np.array([figures[name] for name in FIGURES], dtype=float)
        between = np.array([ends[name] for name in FIGURES], dtype=float)
        # A resampled maximum never exceeds the measured one, and a figure need not be inside its interval.
        bars = {
            "type": "data",
            "symmetric": False,
            "array": np.maximum(between[:, 1] - values, 0.0),
            "arrayminus": np.maximum(values - between[:, 0], 0.0),
            "color": INK,
            "thickness": 1.2,
        }
        color = {"color": COLORS[held.model]}
        name = f"model {held.model}"
        traces.append(
            {"type": "bar", "name": name, "x": list(FIGURES.values()), "y": values, "error_y": bars, "marker": color}
        )
    return Drawing(
        traces, {"barmode": "group", "yaxis": {"title": {"text": "position error (µm)"}, "rangemode": "tozero"}}
    )


def angles_drawing(comparison: Comparison, angle: str = "alpha") -> Drawing:
    """An Euler angle (ZYZ), measured less predicted, of each held-out pose.

    Raises
    ------
    DatasetError
        If orientation was not measured, or there is no such angle.
    """
    names = [name for name, _ in ANGLES.options]
    turned = [held for held in comparison.held if held.angles is not None]
    if not turned:
        raise DatasetError("orientation was not measured", hint="give qw qx qy qz")
    if angle not in names:
        raise DatasetError(f"there is no angle {angle!r}", hint=f"give one of {', '.join(names)}")
    traces = []
    for held in turned:
        assert held.angles is not None
        rows = shown(len(held.position))
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": f"model {held.model}",
                "x": rows,
                "y": 1e3 * held.angles[rows, names.index(angle)],
                "line": {"width": 1.2, "color": COLORS[held.model]},
            }
        )
    titles = {"xaxis": "held-out pose, in the dataset's order", "yaxis": f"{angle} (mrad)"}
    return Drawing(traces, {axis: {"title": {"text": text}} for axis, text in titles.items()})


def carts_drawing(carts: CartMeasurements) -> Drawing:
    """Residuals of a straight line fitted to each cart's measured positions."""
    traces = []
    for j in range(carts.n_actuators):
        line = Linearity.of(carts, j + 1)
        rows = shown(len(line.q))
        places = {"x": line.q[rows], "y": 1e6 * line.absolute[rows]}
        traces.append({"type": "scatter", "mode": "lines", "name": f"cart {j + 1}"} | places)
    off = {"title": {"text": "off a straight line (µm)"}, "rangemode": "tozero"}
    return Drawing(traces, {"xaxis": {"title": {"text": "commanded position (m)"}}, "yaxis": off})
