"""Figures of residuals against each command and covariate, with the causes' prediction."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gtpin.report.embedded import Plot, PlotChoice, escaped
from gtpin.report.figure import Drawing, alone, scatter, titled
from gtpin.report.palette import DATA, DIVERGING, FIT, INK, ZERO
from gtpin.report.residual_columns import ColumnFit, View, column, columns, commanded, view
from gtpin.report.residuals import Residuals, evenly
from gtpin.report.words import coordinate_words

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

MOST = 1000
"""Largest number of poses in a plot; of more, an even selection is shown."""
QUARTILES = (0.0, 0.25, 0.5, 0.75, 1.0)
POINTS = {"size": 4.5, "opacity": 0.6}
LAYERS = PlotChoice("layer", "Left by", (("before", "geometry alone"), ("after", "geometry with the causes")))
ONE_LAYER = PlotChoice("layer", "Left by", LAYERS.options[:1])
"""The choice of layer where there are no causes."""


def shown(count: int) -> npt.NDArray[np.intp]:
    """The rows that plots show."""
    return evenly(count, MOST)


def selection(residuals: Residuals) -> str:
    """How many poses the plots show, as text; empty if they show all."""
    drawn = len(shown(len(residuals)))
    if drawn == residuals.used:
        return ""
    if not residuals.of_poses and len(residuals) == residuals.used:
        return f"A plot shows at most {MOST:,} residuals of an instrument, selected evenly."
    means = "" if len(residuals) == residuals.used else f", and their lines come from {len(residuals):,}"
    return f"The plots show {drawn:,} of {residuals.used:,} measurements{means}, selected evenly."


def residual_figure(
    residuals: Residuals, against: str, component: str, *, causes: bool = False, after: bool = False
) -> Figure:
    """Residuals against a column.

    ``against``: a command (``q1``) or covariate. ``component``: component: ``x``, ``rx``, ``cart2``; with several
    instruments also ``wire`` or ``cup.x``. ``causes``: whether to draw the causes' prediction. ``after``: True: residuals
    of geometry with the causes; False: of geometry alone.
    """
    drawing = _drawing(residuals, column(residuals, against, causes), view(residuals, component), causes, after)
    made = drawing.figure()
    made.update_layout(showlegend=True)
    return alone(made, f"Residuals against {coordinate_words(against)}")


def components(residuals: Residuals, first: str) -> tuple[dict[str, View], PlotChoice]:
    """Views of the residuals along every component, and the choice between them."""
    views = {name: view(residuals, name) for name in residuals.component_names}
    options = sorted(((name, one.title) for name, one in views.items()), key=lambda option: option[0] != first)
    return views, PlotChoice("component", "Component", tuple(options))


def against_columns(
    residuals: Residuals, share: Mapping[str, float], views: Mapping[str, View], follows: tuple[PlotChoice, PlotChoice]
) -> list[Plot]:
    """Plots of residuals against each command and covariate that varies.

    ``share``: strength of the correlation with each column, by name. ``views``: residuals by component. ``follows``: the
    choices of component and layer. Where there are two layers, the first also shows the causes' prediction.
    """
    causes = len(follows[1].options) > 1

    def draw(one: ColumnFit, component: str, layer: str) -> Drawing:
        return _drawing(residuals, one, views[component], causes, layer == "after")

    return [
        Plot(
            f"against-{one.name}",
            f"Residuals against {coordinate_words(one.name)}",
            partial(draw, one),
            follows,
            height=230 if one.line is None else 280,
            whole=one.line is not None,
        )
        for one in columns(residuals, share, causes)
    ]


def over_two(residuals: Residuals, a: str, b: str, views: Mapping[str, View], component: PlotChoice) -> Plot:
    """Residuals over two commands, in colour, for a dependence on both."""
    return Plot("left", f"Residuals over {a} and {b}", partial(_over_two, residuals, a, b, views), (component,))


def _over_two(residuals: Residuals, a: str, b: str, views: Mapping[str, View], component: str) -> Drawing:
    seen, q = views[component], commanded(residuals)
    rows = _drawn(seen)
    bar = {"thickness": 9, "outlinewidth": 0, "title": {"text": seen.title, "side": "right"}}
    color = {"colorscale": DIVERGING, "cmid": 0, "color": seen.after[rows], "showscale": True, "colorbar": bar}
    marker = {"size": 8, "line": {"color": ZERO, "width": 0.5}} | color
    hover = "%{marker.color:.3g}<br>pose %{text}<extra></extra>"
    trace = scatter("markers", q[a][rows], q[b][rows], marker=marker, text=residuals.names[rows], hovertemplate=hover)
    return Drawing([trace], titled(f"{a} (m)", f"{b} (m)", margin={"t": 10}))


def _drawn(seen: View) -> npt.NDArray[np.intp]:
    """The rows with a component that plots show."""
    return seen.rows[shown(len(seen.rows))]


def _drawing(residuals: Residuals, against: ColumnFit, seen: View, causes: bool, after: bool) -> Drawing:
    rows = _drawn(seen)
    left = seen.left("after" if after else "before")
    made = (seen.before - seen.after)[rows] if causes and not after else None
    if against.order is not None:
        traces = _boxes(against, rows, left[rows], made)
        axis: dict[str, Any] = {"type": "category", "automargin": "height"}
        axis |= {"categoryorder": "array", "categoryarray": list(against.order)}
    else:
        traces = _dots(residuals, against, rows, left[rows], made)
        if against.line is not None and not after:  # not means, which would average out a short period
            traces.append(_cause_line(against, seen))
        else:
            traces.append(_means(against, seen.rows, left))
        axis = {"hoverformat": ".4g"}
    # Hover numbers use the axes' formats: unlike those of a hover template, they have a true minus sign.
    layout = titled(against.title, seen.title, showlegend=False, margin={"t": 10})
    layout["xaxis"] |= axis
    if against.order is not None:
        layout["scattermode"] = "group"
    layout["yaxis"]["hoverformat"] = ".3g"
    return Drawing(traces, layout)


def _dots(
    residuals: Residuals,
    against: ColumnFit,
    rows: npt.NDArray[np.intp],
    left: npt.ArrayLike,
    made: npt.ArrayLike | None,
) -> list[Any]:
    hover = f"%{{y}} at {escaped(against.name)} = %{{x}}<br>pose %{{text}}<extra></extra>"
    layers = [(left, "residual", DATA), (made, "predicted from the causes", FIT)]
    return [
        scatter("markers", against.values[rows], y, name=name, marker=POINTS | {"color": color})
        | {"text": residuals.names[rows], "hovertemplate": hover}
        for y, name, color in layers
        if y is not None
    ]


def _boxes(
    against: ColumnFit, rows: npt.NDArray[np.intp], left: npt.ArrayLike, made: npt.ArrayLike | None
) -> list[Any]:
    """For each value a mark at the median, a thick line between the quartiles, and a thin one to the ends."""
    names, of = np.unique(against.values[rows].astype(str), return_inverse=True)
    layers = [
        (left, "residuals of one value: median, quartiles, ends", DATA),
        (made, "predicted from the causes", FIT),
    ]
    traces = []
    for y, name, color in layers:
        if y is None:
            continue
        groups = [np.asarray(y)[of == k] for k in range(len(names))]
        low, first, middle, third, high = np.array([np.quantile(group, QUARTILES) for group in groups]).T
        for below, above, look in (
            (low, high, {"thickness": 1.2, "width": 5}),
            (first, third, {"thickness": 14, "width": 0}),
        ):
            bars = {
                "type": "data",
                "symmetric": False,
                "array": above - middle,
                "arrayminus": middle - below,
                "color": color,
            }
            traces.append(scatter("markers", names, middle, name=name, error_y=bars | look, offsetgroup=name))
            traces[-1] |= {"marker": {"color": color, "symbol": "line-ew-open", "size": 14}, "hoverinfo": "y"}
    return traces


def _cause_line(against: ColumnFit, seen: View) -> dict[str, Any]:
    assert against.line is not None
    name, look = "the same along the column, all else constant", {"color": FIT, "width": 1.4}
    y = seen.factor * against.line.fit[seen.name]
    return scatter("lines", against.line.x, y, name=name, hoverinfo="skip", line=look)


def _means(against: ColumnFit, rows: npt.NDArray[np.intp], left: npt.NDArray[np.float64]) -> dict[str, Any]:
    values, groups = against.values.astype(float), against.groups(rows)
    x, y = (np.array([of[group].mean() for group in groups]) for of in (values, left))
    return scatter(
        "lines", x, y, name="mean of neighbouring poses", hoverinfo="skip", line={"color": INK, "width": 1.6}
    )
