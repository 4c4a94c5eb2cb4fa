"""Circular tests in a dataset's ranges: deviations of the radius along circles about a station, as ball bars measure them.

The quantities are those of ISO 230-4, Circular tests for numerically controlled machine tools.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gtpin.errors import DatasetError
from gtpin.instruments.range import Range
from gtpin.report.figure import ACCENT, FIT, LIGHT, LINE, ZERO, Drawing, Plot, alone, escaped, round_below
from gtpin.report.residual_plots import scale_of
from gtpin.report.residuals import Residuals
from gtpin.report.words import quantity, typeset
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Indices

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

Direction = Literal["counterclockwise", "clockwise"]
Layer = Literal["measured", "before", "after"]

STEP, JUMP = np.deg2rad(1.5), np.deg2rad(60.0)
"""Smallest step of a path, as an angle about the point, from which its direction of travel is determined, and the largest step
within one circle."""
KEPT = np.cos(np.deg2rad(35.0))
"""Cosine of the largest angle by which the axis of travel may change from one step to the next."""
HALF = 0.98 * np.pi
"""Smallest swept angle of a circle that is shown, rad: half a turn, less the gap between its last and first readings."""
LEAST = 8
"""Smallest number of readings of a circle that is shown."""
ROUND, FLAT = 0.15, 0.05
"""Largest variation of a circle's radius, and largest distance from its plane, over its radius. A station that is set up by eye
is not at the circle's centre, so that the distance from it varies."""
SAME_PLANE = np.cos(np.deg2rad(5.0))
"""Smallest cosine of the angle between the planes of two runs along one circle."""
SAME_RADIUS = 0.05
"""Largest difference of the radii, and of the heights of the planes, of two runs along one circle, over the radius."""
ALONG_AXIS = np.cos(np.deg2rad(5.0))
"""Smallest cosine of the angle between the normal of a plane that is called XY, YZ or ZX, and the axis normal to it."""


@dataclass(frozen=True, eq=False)
class Run:
    """One run along a circle.

    ``rows``: (m,) rows of the path, in the order of travel. ``normal``: (3,) unit normal of its plane; the direction of
    travel is counterclockwise about it. ``swept``: swept angle, rad, positive.
    """

    rows: Indices
    normal: Floats
    swept: float


@dataclass(frozen=True, eq=False)
class Trace:
    """Deviations of the radius on one run along a circle.

    - ``direction``: direction of travel; counterclockwise: from the circle's first axis to its second.
    - ``rows``: (m,) rows of the residuals, in the order of travel.
    - ``angle``: (m,) commanded angle from the first axis to the second, rad.
    - ``deviation``: by layer (m,), m, positive away from the centre. ``measured``: about the least-squares circle of all
      runs along it. ``before`` and ``after``: residuals of geometry alone and of geometry with the causes.
    """

    direction: Direction
    rows: Indices
    angle: Floats
    deviation: Mapping[Layer, Floats]


@dataclass(frozen=True, eq=False)
class Circle:
    """A circular test: readings of one station and target along one circle.

    - ``instrument``, ``station``, ``target``: names of the instrument, station and target; the latter two are "" where
      there is only one.
    - ``normal``: (3,) unit normal of its plane, base frame.
    - ``radius``: commanded radius, m.
    - ``traces``: the runs along it.
    """

    instrument: str
    station: str
    target: str
    normal: Floats
    radius: float
    traces: tuple[Trace, ...]

    @property
    def plane(self) -> str:
        """Name of its plane: ``XY``, ``YZ`` or ``ZX``; of other planes the normal: ``normal (0.34, 0.00, 0.94)``."""
        if self.normal.max() >= ALONG_AXIS:
            return "".join(self.axes)
        return f"normal ({', '.join(f'{v + 0.0:.2f}' for v in self.normal)})"

    @property
    def axes(self) -> tuple[str, str]:
        """Names of its first and second axis; in a plane that is not XY, YZ or ZX, of the base axes nearest to them."""
        axis = int(np.argmax(self.normal))
        return "YZX"[axis], "ZXY"[axis]

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The directions of travel that were measured, counterclockwise first."""
        return tuple(sorted({trace.direction for trace in self.traces}, reverse=True))

    def radial(self, layer: Layer, direction: Direction | None) -> tuple[float, float]:
        """Radial deviations F of a direction, or of both: the smallest and the largest, m."""
        values = np.concatenate([t.deviation[layer] for t in self.traces if direction in (t.direction, None)])
        return float(values.min()), float(values.max())

    def circular(self, layer: Layer, direction: Direction | None = None) -> float:
        """Circular deviation G, m: the range of the deviations of a direction; None: of both, the bidirectional G(b)."""
        low, high = self.radial(layer, direction)
        return high - low


def circles(residuals: Residuals) -> tuple[Circle, ...]:
    """The circular tests among the readings of ``range`` instruments; empty where there are none.

    Rows are taken in the order of ``time``, where there is one, else in that of the table.
    """
    ranges = [(i, one) for i, one in enumerate(residuals.readings.instruments) if isinstance(one, Range)]
    return tuple(circle for i, one in ranges for circle in _of_instrument(residuals, i, one))


def _of_instrument(residuals: Residuals, index: int, one: Range) -> Iterator[Circle]:
    readings = residuals.readings
    mine = readings.rows.rows_of(index)
    away = one.away(residuals.poses[mine], readings.own(index))
    order = np.asarray(residuals.dataset.covariates.get("time", readings.rows.line), dtype=float)[mine]
    for station, target in np.unique(np.column_stack([one.station, one.targets.of]), axis=0):
        own = np.flatnonzero((one.station == station) & (one.targets.of == target))
        own = own[np.argsort(order[own], kind="stable")]
        stations, targets = list(one.table.stations), list(one.table.fixed_targets)
        names = (stations[station] if len(stations) > 1 else "", targets[target] if len(targets) > 1 else "")
        for same in _groups(runs(away[own]), away[own]):
            yield _circle(residuals, mine, one, [replace(run, rows=own[run.rows]) for run in same], names)


def _groups(found: list[Run], away: Floats) -> list[list[Run]]:
    """Runs along the same circle together."""
    groups: list[list[Run]] = []
    for run in found:
        same = next((group for group in groups if _alike(run, group[0], away)), [])
        if not same:
            groups.append(same)
        same.append(run)
    return groups


def _alike(one: Run, two: Run, away: Floats) -> bool:
    if abs(float(one.normal @ two.normal)) < SAME_PLANE:
        return False
    radii = [float(np.linalg.norm(away[run.rows], axis=1).mean()) for run in (one, two)]
    heights = [float((away[run.rows] @ one.normal).mean()) for run in (one, two)]
    most = SAME_RADIUS * radii[0]
    return abs(radii[0] - radii[1]) < most and abs(heights[0] - heights[1]) < most


def _circle(residuals: Residuals, mine: Indices, one: Range, same: list[Run], names: tuple[str, str]) -> Circle:
    """The circle of the runs ``same``. Their rows are indices into ``mine``, the instrument's rows."""
    normal = same[0].normal * np.sign(same[0].normal[np.argmax(np.abs(same[0].normal))])
    rows = np.concatenate([run.rows for run in same])
    nominal = replace(residuals.model, geometry=Geometry.nominal(residuals.model.robot), effects=())
    poses = nominal.kinematics.forward(residuals.dataset.q[mine])
    commanded = one.away(poses, np.zeros(len(one.unknowns)))[rows]
    flat, height = commanded @ np.transpose(plane_axes(normal)), float((commanded @ normal).mean())
    # |p - c|^2 = r^2 is linear in the centre c and k = r^2 - |c|^2: |p|^2 = 2 p . c + k.
    matrix = np.column_stack([2.0 * flat, np.ones(len(flat))])
    middle = np.asarray(np.linalg.lstsq(matrix, (flat**2).sum(axis=1), rcond=None)[0][:2])
    angle = np.arctan2(*(flat - middle).T[::-1])
    measured = centred(flat, height, one.measured()[rows, 0], middle)
    traces, ends = [], np.cumsum([len(run.rows) for run in same])[:-1]
    for run, its_angle, its_deviation in zip(same, np.split(angle, ends), np.split(measured, ends), strict=True):
        own = mine[run.rows]
        left: dict[Layer, Floats] = {"before": residuals.before[own, 0], "after": residuals.after[own, 0]}
        direction: Direction = "counterclockwise" if float(run.normal @ normal) > 0.0 else "clockwise"
        traces.append(Trace(direction, own, its_angle, {"measured": its_deviation, **left}))
    radius = float(np.linalg.norm(flat - middle, axis=1).mean())
    return Circle(one.name, *names, normal, radius, tuple(traces))


def centred(flat: Floats, height: float, measured: Floats, start: Floats) -> Floats:
    """(N,) deviations of the ranges about their least-squares circle, m.

    They are the measured ranges less |p - s| - o, with the centre s, in the plane, and the offset o that fit best.

    ``flat``, ``height``: (N, 2) the commanded path p along the axes of its plane, and the plane's height over the station,
    m. ``start``: (2,) first guess of s.
    """

    from scipy.optimize import least_squares

    def less_distance(s: Floats) -> Floats:
        beyond = measured - np.sqrt(((flat - s) ** 2).sum(axis=1) + height**2)
        return np.asarray(beyond - beyond.mean())  # the offset that fits best is the mean

    return np.asarray(least_squares(less_distance, start, jac="3-point", method="lm", xtol=1e-15, ftol=1e-15).fun)


def runs(away: Floats) -> list[Run]:
    """The circles of a path.

    ``away``: (N, 3) vectors from the point to the positions of the path, in the order of travel, m.
    """
    found = [_run(np.arange(a, b), away[a:b]) for a, b in _parts(away)]
    return [run for run in found if run is not None]


def _parts(away: Floats) -> list[tuple[int, int]]:
    """First row, and the row after the last, of each part that turns about one axis."""
    direction = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12)
    starts, last, axis = [0], 0, None
    for i in range(1, len(direction)):
        cross = np.cross(direction[last], direction[i])
        sine = float(np.linalg.norm(cross))
        angle = float(np.arctan2(sine, direction[last] @ direction[i]))
        if angle > JUMP:
            starts.append(i)
            last, axis = i, None
        elif angle >= STEP:
            turning = cross / sine
            if axis is not None and float(turning @ axis) < KEPT:
                starts.append(last + 1)  # the path turned back, or left the plane, after the last step
                turning = None
            last, axis = i, turning
    return list(zip(starts, [*starts[1:], len(away)], strict=True))


def _run(rows: Indices, away: Floats) -> Run | None:
    """A part of a path as a circle; None if it is no circle."""
    if len(rows) < LEAST:
        return None
    middle = away.mean(axis=0)
    normal = np.linalg.svd(away - middle, full_matrices=False)[2][2]
    radius = np.linalg.norm(away, axis=1)
    round_ = np.abs(radius / radius.mean() - 1.0).max() <= ROUND
    flat = np.abs((away - middle) @ normal).max() <= FLAT * radius.mean()
    across, along = plane_axes(normal)
    angle = np.unwrap(np.arctan2(away @ along, away @ across))
    swept = float(angle[-1] - angle[0])
    return Run(rows, np.sign(swept) * normal, abs(swept)) if round_ and flat and abs(swept) >= HALF else None


def plane_axes(normal: Floats) -> tuple[Floats, Floats]:
    """(3,) unit vectors e1 and e2 of a plane, with e1 x e2 = normal; of the planes XY, YZ and ZX, their axes.

    e1 is a base axis, projected on the plane: in the cyclic order x, y, z the one after the axis that is nearest to the normal.
    """
    first = np.zeros(3)
    first[(int(np.argmax(np.abs(normal))) + 1) % 3] = 1.0
    first -= (first @ normal) * normal
    first /= np.linalg.norm(first)
    return first, np.asarray(np.cross(normal, first))


COLORS = {"counterclockwise": ACCENT, "clockwise": FIT}
INSIDE, OUTSIDE = 2.2, 1.15
"""Space in the plot inside and outside the circle of zero deviation, over the largest deviation."""
AROUND = np.linspace(0.0, 360.0, 181)
"""Angles of a drawn circle, degrees."""
LAYERS: dict[Layer, str] = {
    "measured": "As measured",
    "before": "Left by geometry alone",
    "after": "Left by geometry with the causes",
}


def circular_tests(residuals: Residuals, causes: bool) -> list[tuple[str, list[Plot]]]:
    """The titles of the circles along which readings were taken, each with one plot for each layer.

    ``causes``: whether there are causes: a last layer then shows the residuals with them.
    """
    layers, margin = _layers(causes), {"t": 24, "b": 24, "l": 30, "r": 30}

    def draw(circle: Circle, layer: Layer) -> Drawing:
        layout = {"polar": _polar(circle, layer, layers), "showlegend": False, "margin": margin}
        return Drawing(_traces(residuals, circle, layer, layers), layout)

    def plot(number: int, circle: Circle, layer: Layer) -> Plot:
        name, title = f"circle-{number}-{layer}", f"{_name(circle)}: {LAYERS[layer].lower()}"
        caption = f"{'. '.join(_words(circle, layer, layers))}."
        return Plot(name, title, partial(draw, circle, layer), caption=caption, height=300)

    found = enumerate(circles(residuals))
    return [(_name(circle), [plot(k, circle, layer) for layer in layers]) for k, circle in found]


def ball_bar_figure(residuals: Residuals, number: int, causes: bool) -> Figure:
    """The layers of a circle, side by side; ``number``: its index in the data, ``causes``: as in :func:`circular_tests`.

    Raises `DatasetError` if there is no such circle.
    """
    found = circles(residuals)
    if not found:
        hint = "a circular test has readings of a range instrument along half a turn or more about its station"
        raise DatasetError("no readings lie on circles", hint=hint)
    if not 0 <= number < len(found):
        raise DatasetError(f"there is no circle {number}", hint=f"there are {len(found)}, counted from 0")
    circle, layers = found[number], _layers(causes)
    traces: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"annotations": []}
    for k, layer in enumerate(layers):
        suffix = str(k + 1) if k else ""
        traces += [
            trace | {"subplot": f"polar{suffix}", "showlegend": k == 0 and "name" in trace}
            for trace in _traces(residuals, circle, layer, layers)
        ]
        left, right = k / len(layers), (k + 0.88) / len(layers)
        layout[f"polar{suffix}"] = _polar(circle, layer, layers) | {"domain": {"x": [left, right], "y": [0.14, 1.0]}}
        words = {"text": "<br>".join(_words(circle, layer, layers)), "showarrow": False, "font": {"size": 11}}
        place = {"x": (left + right) / 2.0, "y": 0.06, "xanchor": "center", "yanchor": "top"}
        layout["annotations"].append(words | place | {"xref": "paper", "yref": "paper"})
    size = {"width": 400 * len(layers), "height": 560, "margin": {"t": 90, "b": 70}}
    return alone(Drawing(traces, layout), f"Circular test, {_name(circle)}", **size)


def _layers(causes: bool) -> tuple[Layer, ...]:
    return ("measured", "before", "after") if causes else ("measured", "before")


def _traces(residuals: Residuals, circle: Circle, layer: Layer, layers: Sequence[Layer]) -> list[dict[str, Any]]:
    factor, unit, _ = _scale(circle, layer, layers)
    zero = {"r": np.zeros_like(AROUND), "theta": AROUND, "line": {"color": ZERO, "width": 1.4}, "hoverinfo": "skip"}
    traces: list[dict[str, Any]] = [zero | {"showlegend": False}]
    for k, trace in enumerate(circle.traces):
        traces.append(
            {
                "name": trace.direction,
                "theta": np.rad2deg(trace.angle),
                "r": factor * trace.deviation[layer],
                "line": {"color": COLORS[trace.direction], "width": 1.5},
                "text": residuals.names[trace.rows],
                "hovertemplate": f"%{{r:.3g}} {unit} at %{{theta:.0f}}°<br>pose %{{text}}<extra>{trace.direction}</extra>",
                # Each direction once in the legend.
                "showlegend": trace.direction not in [one.direction for one in circle.traces[:k]],
            }
        )
    return [{"type": "scatterpolar", "mode": "lines"} | trace for trace in traces]


def _polar(circle: Circle, layer: Layer, layers: Sequence[Layer]) -> dict[str, Any]:
    """The axes of a plot; the circle of zero deviation is at two thirds of the plot's radius."""
    _, _, top = _scale(circle, layer, layers)
    step = round_below(top / 2.0)  # the largest deviation has two to five steps
    one, two = circle.axes
    grid = {"gridcolor": LINE, "linecolor": LINE}
    radial = {
        "range": [-INSIDE * top, OUTSIDE * top],
        "tickvals": step * np.arange(-np.floor(INSIDE * top / step), np.floor(OUTSIDE * top / step) + 1.0),
        "showticklabels": False,
        "ticks": "",
        "showline": False,
    }
    names = [f"+{one}", f"+{two}", f"−{one}", f"−{two}"]
    around = {"tickvals": [0, 90, 180, 270], "ticktext": [escaped(name) for name in names]}
    return {"bgcolor": LIGHT["paper"], "radialaxis": radial | grid, "angularaxis": around | grid}


def _name(circle: Circle) -> str:
    """A circle in words: ``ballbar XY, radius 150 mm``."""
    ids = "".join(f", {what} {one}" for what, one in (("station", circle.station), ("target", circle.target)) if one)
    return typeset(f"{circle.instrument} {circle.plane}{ids}, radius {quantity(circle.radius, 'm')}")


def _words(circle: Circle, layer: Layer, layers: Sequence[Layer]) -> list[str]:
    """The size of a division of a layer's plot, and its quantities of ISO 230-4, of each direction and of both together."""
    _, unit, top = _scale(circle, layer, layers)
    words = [f"{LAYERS[layer]}, {round_below(top / 2.0):g} {unit} a division"]
    for direction in circle.directions:
        low, high = (f"{'+' if value > 0.0 else ''}{quantity(value, 'm')}" for value in circle.radial(layer, direction))
        words.append(
            f"{direction.capitalize()}: G {quantity(circle.circular(layer, direction), 'm')}, F {low} to {high}"
        )
    if len(circle.directions) > 1:
        words.append(f"Both: G(b) {quantity(circle.circular(layer), 'm')}")
    return words


def _scale(circle: Circle, layer: Layer, layers: Sequence[Layer]) -> tuple[float, str, float]:
    """Factor from m to the unit of a layer's plot, the unit, and the largest deviation in this unit; ``before`` and ``after``
    have one scale, because they are compared."""
    alike = [one for one in layers if (one == "measured") == (layer == "measured")]
    values = np.concatenate([t.deviation[one] for t in circle.traces for one in alike])
    factor, unit = scale_of(values, "m")
    return factor, unit, factor * max(float(np.abs(values).max()), 1e-12)
