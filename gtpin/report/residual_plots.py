"""Residuals against each command and covariate, with the causes' prediction along it, and over the workspace: components,
columns, maps, and figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gtpin.data.names import command_names
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import Column as Values
from gtpin.errors import DatasetError
from gtpin.report.dataset import VIEWS, map_layout, map_points
from gtpin.report.figure import (
    DATA,
    DIVERGING,
    FIT,
    INK,
    SCALE,
    ZERO,
    Drawing,
    Plot,
    PlotChoice,
    alone,
    colorbar,
    escaped,
    round_below,
    scatter,
    titled,
)
from gtpin.report.residuals import Residuals, evenly, fine
from gtpin.report.words import coordinate_words, covariate_unit, travel_words, typeset, with_unit
from gtpin.typing import Floats, Indices

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

FEW = 8
"""Largest number of different values of a covariate that is shown by box plots."""
GROUPS = 18
"""Largest number of groups of neighbouring poses whose means are drawn."""
LEVELS = 4
"""Largest number of values of a second coordinate for which one line per value is drawn."""
LINE_SHARE = 0.5
"""Smallest fraction of the causes' power that the line must explain; with less, the causes depend more on other coordinates."""
MOST = 1000
"""Largest number of poses in a plot; of more, an even selection is shown."""
POINTS = {"size": 4.5, "opacity": 0.6}
LAYERS = PlotChoice("layer", "Left by", (("before", "geometry alone"), ("after", "geometry with the causes")))
ONE_LAYER = PlotChoice("layer", "Left by", LAYERS.options[:1])
"""The choice of layer where there are no causes."""


@dataclass(frozen=True)
class View:
    """Residuals along one component.

    - ``name``, ``title``: the component, and the title of its axis.
    - ``before``, ``after``: (N,) residuals of geometry alone and of geometry with the causes, in the title's unit; NaN in
      rows without the component.
    - ``factor``: factor from m or rad to this unit.
    - ``rows``: indices of the rows that have the component.
    """

    name: str
    title: str
    before: Floats
    after: Floats
    factor: float
    rows: Indices

    @property
    def drawn(self) -> Indices:
        """Indices of the rows that a plot shows."""
        return self.rows[shown(len(self.rows))]


@dataclass(frozen=True)
class ColumnFit:
    """A command or covariate that residuals are plotted against.

    - ``name``, ``title``: the column, and the title of its axis.
    - ``values``: (N,) its values; texts where there are few different ones, which are then shown by box plots.
    - ``order``: the few different values, in order; None for a column of numbers.
    - ``line``: the causes' prediction of the residuals along the column, from :func:`fit_along`; None: no cause depends on it.
    """

    name: str
    title: str
    values: npt.NDArray[np.generic]
    order: tuple[str, ...] | None
    line: dict[str, tuple[Floats, Floats]] | None

    def groups(self, rows: Indices) -> list[Indices]:
        """Groups of neighbouring poses, among some rows, whose means are drawn; poses of one value are in one group."""
        count = min(GROUPS, max(1, len(rows) // 6))
        values = self.values[rows].astype(float)
        edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1]))
        group = np.searchsorted(edges, values)
        return [rows[group == k] for k in np.unique(group)]


def scale_of(values: Floats, unit: str) -> tuple[float, str]:
    """The factor to mm or µm (mrad or µrad), depending on the largest value, and the unit's name."""
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    return (1e3, f"m{unit}") if largest >= 2e-3 else (1e6, f"µ{unit}")


def view(residuals: Residuals, name: str) -> View:
    """Residuals along an axis (``x``, ``rx``) or the travel of an actuator (``cart2``), or of a reading (``wire``, ``cup.x``).

    Raises `DatasetError` if there is no such component.
    """
    if name not in residuals.component_names:
        hint = f"there are {', '.join(residuals.component_names)}"
        raise DatasetError(f"residuals have no component {name!r}", hint=hint)
    before, after = residuals.component(name, residuals.before), residuals.component(name, residuals.after)
    factor, unit = scale_of(before, residuals.unit(name))
    title = f"{name} ({unit})" if name in residuals.axes else f"{travel_words(residuals.model.robot, name)} ({unit})"
    return View(name, title, factor * before, factor * after, factor, residuals.rows_of(name))


def leading(residuals: Residuals, sites: Sequence[str], axes: Mapping[str, float]) -> str:
    """The component that is shown first: the travel of the first site that is an actuator's, else the axis with the largest
    share.

    For readings, it is the component of which the causes explain most, in units of its noise: few readings determine a travel
    well.
    """
    if not residuals.of_poses:
        made = (residuals.before - residuals.after) / residuals.sigma
        return max(residuals.axes, key=lambda axis: float(np.nanmean(residuals.component(axis, made) ** 2)))
    for site in sites:
        if site in residuals.model.robot.sites:
            return site
    return max(residuals.axes, key=lambda axis: axes.get(axis, 0.0))


def columns(residuals: Residuals, share: Mapping[str, float], causes: bool) -> list[ColumnFit]:
    """Each command and covariate that varies: first those on which a cause depends, then those with the strongest correlation.

    ``share``: strength of the residuals' correlation with each, by name. ``causes``: whether there are causes.
    """
    commands = command_names(residuals.dataset.n_actuators)
    varying = [n for n, values in residuals.columns.items() if n in commands or bool((values != values[0]).any())]
    found = [column(residuals, name, causes) for name in varying]
    return sorted(found, key=lambda one: (one.line is None, -share.get(one.name, 0.0)))


def column(residuals: Residuals, name: str, causes: bool = True) -> ColumnFit:
    """A command (``q1``) or covariate.

    Raises `DatasetError` if the dataset has no such column.
    """
    known = residuals.columns
    if name not in known:
        raise DatasetError("this column is not there", column=name, hint=f"there are {', '.join(known)}")
    values = known[name]
    title = escaped(with_unit(name, covariate_unit(name, residuals.model.robot)))
    if name != "session" and len(np.unique(values.astype(float))) > FEW:
        return ColumnFit(name, title, values, None, fit_along(residuals, name) if causes else None)
    words = [escaped(str(v) if name == "session" else typeset(f"{float(v):g}")) for v in values.tolist()]
    order = dict.fromkeys(words[i] for i in np.argsort(values, kind="stable"))
    return ColumnFit(name, title, np.array(words, dtype=object), tuple(order), None)


def fit_along(residuals: Residuals, name: str) -> dict[str, tuple[Floats, Floats]] | None:
    """The causes' prediction by component: (m,) values of a numeric column on a fine grid, and (m,) residuals, with all other
    coordinates held constant; None if no cause depends on the column, or depends more on another coordinate.

    It is the causes' displacement, plus a straight line that is fitted to the rest of ``before - after`` of the residuals,
    because geometry absorbs a straight line. If the causes also depend on a coordinate with few values, such as a direction of
    approach, there is one line for each value, and NaN between two.
    """
    model, column = residuals.model, residuals.columns.get(name)
    own = tuple(e for e in model.effects if name in e.effect.coordinates(model.robot, e.site))
    if column is None or not own or not residuals.of_poses:
        return None
    data = np.asarray(column, dtype=float)
    grid = fine(data, any(e.effect.has_nonlinear for e in own))
    there = _made(residuals, own, residuals.dataset.q, residuals.dataset.covariates)
    levels = _levels(residuals, own, name)
    middles = [residuals.middle({name: grid, **given}) for given, _ in levels]
    made = [_made(residuals, own, q, known) for q, known in middles]
    seen = np.zeros_like(there)
    for (_, rows), line in zip(levels, made, strict=True):
        seen[rows] = np.stack([np.interp(data[rows], grid, part) for part in line.T], axis=1)
    power, missed = (float((np.var(part, axis=0) / residuals.sigma[0] ** 2).sum()) for part in (there, there - seen))
    if not missed <= (1.0 - LINE_SHARE) * power:  # also false if the line has poses that the robot can't reach
        return None
    moved = [model.kinematics.command_jacobian(q, model.kinematics.forward(q)) for q, _ in middles]
    gap, fit = [np.nan], {}
    x = np.concatenate([part for _ in levels for part in (grid, gap)])
    for c in residuals.component_names:
        taken = residuals.component(c, residuals.before - residuals.after - seen)
        slope, level = np.polyfit(data, taken, 1)
        lines = [residuals.component(c, *both) + (slope * grid + level) for both in zip(made, moved, strict=True)]
        fit[c] = (x, np.concatenate([part for line in lines for part in (line, gap)]))
    return fit


def _made(residuals: Residuals, own: tuple[ActiveEffect, ...], q: Floats, known: Mapping[str, Values]) -> Floats:
    """(N, c) displacement of the poses by some effects alone."""
    with_them, plain = (replace(residuals.model, effects=effects) for effects in (own, ()))
    return with_them.predict(q, known).minus(plain.predict(q))[:, : residuals.before.shape[1]]


def _levels(
    residuals: Residuals, own: Sequence[ActiveEffect], name: str
) -> list[tuple[dict[str, object], npt.NDArray[np.bool_]]]:
    """Values of the first other coordinate on which causes depend, if they are few, and the poses of each value."""
    others = [other for e in own for other in e.effect.coordinates(residuals.model.robot, e.site) if other != name]
    for other in others:
        values = residuals.columns.get(other)
        levels = [] if values is None else list(dict.fromkeys(values.tolist()))
        if 1 < len(levels) <= LEVELS:
            return [({other: level}, np.asarray(values == level)) for level in levels]
    return [({}, np.ones(len(residuals), dtype=bool))]


def shown(count: int) -> Indices:
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
    """A component (``x``, ``rx``, ``cart2``, ``cup.x``) of the residuals against a command (``q1``) or covariate.

    ``causes``: whether to draw the causes' prediction. ``after``: True: residuals of geometry with the causes; False: of
    geometry alone.
    """
    drawing = _drawing(residuals, column(residuals, against, causes), view(residuals, component), causes, after)
    return alone(drawing, f"Residuals against {coordinate_words(against)}", showlegend=True)


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

    plots = []
    for one in columns(residuals, share, causes):
        title, fitted = f"Residuals against {coordinate_words(one.name)}", one.line is not None
        height = 280 if fitted else 230
        plots.append(Plot(f"against-{one.name}", title, partial(draw, one), follows, height=height, whole=fitted))
    return plots


def over_two(residuals: Residuals, a: str, b: str, views: Mapping[str, View], component: PlotChoice) -> Plot:
    """Residuals over two commands, in colour, for a dependence on both."""

    def draw(component: str) -> Drawing:
        seen, q = views[component], residuals.columns
        rows = seen.drawn
        marker = {"size": 8, "line": {"color": ZERO, "width": 0.5}, "colorscale": DIVERGING, "cmid": 0}
        marker |= {"color": seen.after[rows], "showscale": True, "colorbar": colorbar(seen.title)}
        about = {"text": residuals.names[rows], "hovertemplate": "%{marker.color:.3g}<br>pose %{text}<extra></extra>"}
        trace = scatter("markers", q[a][rows], q[b][rows], marker=marker, **about)
        titles = (with_unit(name, covariate_unit(name, residuals.model.robot)) for name in (a, b))
        return Drawing([trace], titled(*titles, margin={"t": 10}))

    return Plot("left", f"Residuals over {a} and {b}", draw, (component,))


def _drawing(residuals: Residuals, against: ColumnFit, seen: View, causes: bool, after: bool) -> Drawing:
    rows, residual, few = seen.drawn, seen.after if after else seen.before, against.order is not None
    layers = [(residual[rows], "residuals of one value: median, quartiles, ends" if few else "residual", DATA)]
    if causes and not after:
        layers.append(((seen.before - seen.after)[rows], "predicted from the causes", FIT))
    # Hover numbers use the axes' formats: unlike those of a hover template, they have a true minus sign.
    layout = titled(against.title, seen.title, showlegend=False, margin={"t": 10})
    layout["yaxis"]["hoverformat"] = ".3g"
    if against.order is not None:
        order = {"categoryorder": "array", "categoryarray": list(against.order)}
        layout["xaxis"] |= {"type": "category", "automargin": "height"} | order
        layout["scattermode"] = "group"
        return Drawing([box for layer in layers for box in _boxes(against.values[rows], *layer)], layout)
    layout["xaxis"]["hoverformat"] = ".4g"
    hover = f"%{{y}} at {escaped(against.name)} = %{{x}}<br>pose %{{text}}<extra></extra>"
    about = {"text": residuals.names[rows], "hovertemplate": hover}
    traces = [
        scatter("markers", against.values[rows], y, name=name, marker=POINTS | {"color": color}) | about
        for y, name, color in layers
    ]
    if against.line is not None and not after:  # not means, which would average out a short period
        x, y = against.line[seen.name][0], seen.factor * against.line[seen.name][1]
        name, look = "the same along the column, all else constant", {"color": FIT, "width": 1.4}
    else:
        groups, values = against.groups(seen.rows), against.values.astype(float)
        x, y = (np.array([of[group].mean() for group in groups]) for of in (values, residual))
        name, look = "mean of neighbouring poses", {"color": INK, "width": 1.6}
    return Drawing([*traces, scatter("lines", x, y, name=name, hoverinfo="skip", line=look)], layout)


def _boxes(values: npt.NDArray[np.generic], y: Floats, name: str, color: str) -> Iterator[dict[str, Any]]:
    """For each value a mark at the median, a thin line to the ends, and a thick one between the quartiles."""
    names, of = np.unique(values.astype(str), return_inverse=True)
    quartiles = [np.quantile(y[of == k], (0.0, 0.25, 0.5, 0.75, 1.0)) for k in range(len(names))]
    low, first, middle, third, high = np.array(quartiles).T
    marker = {"color": color, "symbol": "line-ew-open", "size": 14}
    for below, above, thickness, width in ((low, high, 1.2, 5), (first, third, 14, 0)):
        bars = {"type": "data", "symmetric": False, "array": above - middle, "arrayminus": middle - below}
        bars |= {"color": color, "thickness": thickness, "width": width}
        look = {"offsetgroup": name, "marker": marker, "hoverinfo": "y"}
        yield scatter("markers", names, middle, name=name, error_y=bars, **look)


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
