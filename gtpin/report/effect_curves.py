"""Curves of an effect with their 95 % bands, and their figures: a track's straightness, a rack's periodic error, a drift."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import joints
from gtpin.estimate import WIDE
from gtpin.report.effect_motions import FREEDOMS, Motion, motions
from gtpin.report.figure import CURVES, DATA, Drawing, Plot, escaped, scatter, titled
from gtpin.report.residual_plots import POINTS, scale_of, shown
from gtpin.report.residuals import Residuals, fine
from gtpin.report.words import coordinate_words, covariate_unit, joined, quantity, typeset, with_unit
from gtpin.typing import Floats, Indices


@dataclass(frozen=True)
class CurveLine:
    """A curve with its band, and the measurements that belong to it.

    ``label``: label of the line; empty if there is only one. ``x``, ``y``, ``sigma``: (m,) the curve and its standard
    deviations; x is text for sessions. ``points_x``, ``points_y``: (n,) the curve at the measured poses plus the residuals
    there.
    """

    label: str
    x: npt.NDArray[np.generic]
    y: Floats
    sigma: Floats
    points_x: npt.NDArray[np.generic]
    points_y: Floats


@dataclass(frozen=True)
class EffectCurve:
    """One quantity that an effect displaces, as a curve.

    - ``name``, ``unit``: the displaced quantity; m or rad.
    - ``x_title``: the coordinate on which it depends, and its unit.
    - ``lines``: one line, or one for each value of a second coordinate.
    - ``smooth``: whether the lines are continuous; otherwise each point is a pose or a session.
    - ``straightened``: whether a straight line was subtracted, not only the mean.
    - ``lever``: for a robot without rods: mean motion of the TCP over the poses by one unit of the quantity, m per unit;
      else None.
    """

    name: str
    unit: str
    x_title: str
    lines: tuple[CurveLine, ...]
    smooth: bool
    straightened: bool = False
    lever: float | None = None

    @property
    def seen(self) -> bool:
        """Whether it differs from zero by more than its band anywhere."""
        return any(bool((np.abs(line.y) > WIDE * line.sigma).any()) for line in self.lines)

    @property
    def range(self) -> float:
        """Difference between its highest and its lowest point, m or rad."""
        return float(max(line.y.max() for line in self.lines) - min(line.y.min() for line in self.lines))


_Level = tuple[str, OperatingPoints, npt.NDArray[np.generic], Indices]
"""A value of a second coordinate as a label, operating points along the first one and their x, and the poses of this value."""


def curves(active: ActiveEffect, residuals: Residuals) -> tuple[EffectCurve, ...]:
    """The curves of an effect, one for every quantity that it displaces.

    If the effect depends on a coordinate that can be varied alone (a command, time, a temperature), the curve is along this
    coordinate, with all others at their means or medians. If it depends on forces, directions or positions, it is shown at the
    measured poses.
    """
    own = active.effect.coordinates(residuals.model.robot, active.site)
    there = residuals.at(residuals.dataset.q, residuals.dataset.covariates, active.references)
    name, levels = _levels(active, residuals, own)
    return tuple(_swept(active, residuals, there, name, levels) if levels else _at_poses(active, residuals, there, own))


def _levels(active: ActiveEffect, residuals: Residuals, own: tuple[str, ...]) -> tuple[str, list[_Level]]:
    """Name of the coordinate along which curves are drawn, and operating points along it, one for each value of a second
    coordinate; no situations where it can't be varied alone."""

    def at(**given: npt.NDArray[np.generic]) -> OperatingPoints:
        return residuals.at(*residuals.middle(given), active.references)

    robot, every = residuals.model.robot, np.arange(len(residuals))
    if not own or own[0] in ("load", "direction", "position"):
        return "", []
    if "session" in own:
        sessions = np.array(active.references.sessions, dtype=object)
        return "session", [("", at(session=sessions), sessions, every)]
    columns = {name: np.asarray(residuals.columns[name], dtype=float) for name in own if name in residuals.columns}
    swept = [name for name in columns if not name.startswith("approach")]
    if not swept:
        return "", []
    if active.site in robot.sites and len(swept) == robot.n_actuators > 1:
        its_own = f"q{robot.sites.index(active.site) + 1}"
        swept.sort(key=lambda name: name == its_own)  # commands of other actuators first
    first = swept[0]
    grid = fine(columns[first], active.effect.has_nonlinear)
    others = [name for name in columns if name != first]
    if not others:
        return first, [("", at(**{first: grid}), grid, every)]
    other, values = others[0], columns[others[0]]
    steps = [-1.0, 1.0] if other.startswith("approach") else np.quantile(values, (0.1, 0.9)).tolist()
    nearest = np.abs(values[:, None] - np.array(steps)).argmin(axis=1)
    unit = covariate_unit(other, robot)
    levels: list[_Level] = []
    for k, step in enumerate(steps):
        label, there = f"{other} = {step:.3g} {unit}".rstrip(), at(**{first: grid, other: np.full(len(grid), step)})
        levels.append((typeset(label), there, grid, np.flatnonzero(nearest == k)))
    return first, levels


def _swept(
    active: ActiveEffect, residuals: Residuals, there: OperatingPoints, x_name: str, levels: list[_Level]
) -> Iterator[EffectCurve]:
    at_poses = {motion.name: motion for motion in motions(active, there)}
    by_level = [{motion.name: motion for motion in motions(active, at)} for _, at, _, _ in levels]
    sessions, column = x_name == "session", np.asarray(residuals.columns[x_name])
    along = column.astype(str).astype(object) if sessions else column.astype(float)
    title = with_unit(coordinate_words(x_name), covariate_unit(x_name, residuals.model.robot))
    for name, first in by_level[0].items():
        if name not in at_poses or any(name not in level for level in by_level):
            continue
        parts = [level[name].columns for level in by_level]
        straightened = first.straightened and len(levels) == 1 and x_name.startswith("q")
        parts = _less_geometry(parts, np.asarray(levels[0][2], dtype=float) if straightened else None)
        residual = residuals.along(residuals.after, at_poses[name].tcp)
        lines = []
        for (label, _, grid, rows), columns in zip(levels, parts, strict=True):
            y, sigma = _with_sigma(active, columns)
            x = along[rows]
            lines.append(CurveLine(label, grid, y, sigma, x, _between(grid, y, x) + residual[rows]))
        lever = _lever(residuals, at_poses[name])
        yield EffectCurve(name, first.unit, title, tuple(lines), not sessions, straightened, lever)


def _at_poses(
    active: ActiveEffect, residuals: Residuals, at: OperatingPoints, own: tuple[str, ...]
) -> Iterator[EffectCurve]:
    for number, motion in enumerate(motions(active, at)):
        (columns,) = _less_geometry([motion.columns], None)
        y, sigma = _with_sigma(active, columns)
        residual, lever = residuals.along(residuals.after, motion.tcp), _lever(residuals, motion)
        for x_name, unit, x in _places(at, motion, number, own):
            order = np.argsort(x, kind="stable")
            line = CurveLine("", x[order], y[order], sigma[order], x[order], (y + residual)[order])
            yield EffectCurve(motion.name, motion.unit, with_unit(x_name, unit), (line,), smooth=False, lever=lever)


def _places(at: OperatingPoints, motion: Motion, number: int, own: tuple[str, ...]) -> list[tuple[str, str, Floats]]:
    """Coordinates against which an effect of forces, directions or positions is shown."""
    if "load" in own and motion.carried is not None:
        return [(motion.carried.words, motion.carried.unit, motion.carried.at(at))]
    if "load" in own and motion.rod is not None:
        return [(f"force in {at.robot.rod_sites[motion.rod]}", "N", at.force[:, motion.rod])]
    if "direction" in own and motion.rod is not None:
        angles = np.rad2deg(at.tilt[:, motion.rod] * at.references.direction[1][motion.rod])
        return [(f"tilt of {at.robot.rod_sites[motion.rod]}, {k + 1} of 2", "°", angles[:, k]) for k in range(2)]
    axis = number % 3
    return [(f"TCP along {'xyz'[axis]}", "m", at.poses.T[:, axis])]


def _lever(residuals: Residuals, motion: Motion) -> float | None:
    return float(np.linalg.norm(motion.tcp[:, :3], axis=1).mean()) if joints(residuals.model.robot) else None


def _between(x: npt.NDArray[np.generic], y: Floats, at: npt.NDArray[np.generic]) -> Floats:
    if x.dtype == object:
        value = dict(zip(x.tolist(), y.tolist(), strict=True))
        return np.array([value[one] for one in at.tolist()])
    return np.asarray(np.interp(at.astype(float), x.astype(float), y))


def _less_geometry(parts: list[Floats], x: Floats | None) -> list[Floats]:
    """Columns without the part that geometry absorbs: their mean over all parts, and a straight line over x if x is given."""
    whole = np.vstack(parts)
    taken = np.ones((len(whole), 1)) if x is None else np.stack([np.ones(len(x)), x - x.mean()], axis=1)
    residual = whole - taken @ np.linalg.lstsq(taken, whole, rcond=None)[0]
    return np.split(residual, np.cumsum([len(part) for part in parts])[:-1])


def _with_sigma(active: ActiveEffect, columns: Floats) -> tuple[Floats, Floats]:
    variance = np.einsum("nm,mk,nk->n", columns, active.covariance, columns)
    return columns @ active.coefficients, np.sqrt(np.maximum(variance, 0.0))


def drawn_curves(found: Sequence[EffectCurve]) -> list[EffectCurve]:
    """The curves of an effect that are drawn: those that differ from zero, at most six."""
    return ([curve for curve in found if curve.seen] or list(found[:1]))[:6]


def curve_plots(name: str, found: Sequence[EffectCurve]) -> list[Plot]:
    """Plots of an effect's curves; ``name``: beginning of the plots' names."""
    return [
        Plot(f"{name}-{i}", f"{curve.name} against {curve.x_title}", partial(curve_drawing, curve), height=300)
        for i, curve in enumerate(drawn_curves(found))
    ]


def curve_drawing(curve: EffectCurve) -> Drawing:
    """A curve of an effect with its 95 % interval, and the measurements less everything else that the model explains."""
    factor, unit = scale_of(np.concatenate([line.y for line in curve.lines]), curve.unit)
    traces: list[dict[str, Any]] = []
    for k, line in enumerate(curve.lines):
        traces += _traces(curve, line, factor, *CURVES[k % len(CURVES)], rank=2 * k + 1)
    return Drawing(traces, _layout(curve, factor, unit))


def curve_notes(found: Sequence[EffectCurve]) -> list[str]:
    """Notes on an effect's curves: how to read them, and which quantities have no detected displacement."""
    if not found:
        return []
    taken = "mean and a straight line" if any(curve.straightened for curve in found) else "mean"
    held = " Other coordinates on which it depends are held constant." if any(curve.smooth for curve in found) else ""
    notes = [
        f"Curves are without their {taken}, which geometry absorbs; bands: 95 %.{held} Dots: the measurements without "
        "everything else that the model explains."
    ]
    seen = {curve.name for curve in found if curve.seen}
    hidden = list(dict.fromkeys(curve.name for curve in found if curve.name not in seen))
    return notes + ([f"Not detected, but possible for this effect: {joined(hidden)}."] if hidden else [])


def reach(found: Sequence[EffectCurve]) -> str:
    """The largest displacement by an effect in each unit, as text; for a robot without rods also its motion of the TCP."""
    words = []
    for unit in ("m", "rad"):
        seen = [curve for curve in found if curve.unit == unit and curve.seen]
        if not seen:
            continue
        most = max(seen, key=lambda curve: curve.range)
        far = f"{most.name}: {quantity(most.range, unit)} peak to peak"
        if most.lever is not None and not most.name.startswith(FREEDOMS):  # of the tool or the frame: in the shifts
            far += f", {quantity(most.lever * most.range, 'm')} at the TCP"
        words.append(far)
    return "; ".join(words)


def _texts(x: npt.NDArray[np.generic]) -> Any:
    """Values of x as plotly takes them: sessions are text."""
    return [escaped(str(s)) for s in x] if x.dtype == object else x


def _traces(
    curve: EffectCurve, line: CurveLine, factor: float, color: str, band: str, rank: int
) -> list[dict[str, Any]]:
    rows, thin = shown(len(line.points_x)), shown(len(line.x))
    x, y, reach = _texts(line.x[thin]), factor * line.y[thin], factor * WIDE * line.sigma[thin]
    marker = POINTS | {"color": color if len(curve.lines) > 1 else DATA}
    look = {"legendrank": rank + 1, "showlegend": len(line.points_x) > 0, "hoverinfo": "x+y"}
    points = scatter(
        "markers", _texts(line.points_x[rows]), factor * line.points_y[rows], name="measured", marker=marker
    )
    points |= look
    effect = {"name": line.label or f"effect, 95 % {'band' if curve.smooth else 'bars'}", "legendrank": rank}
    if not curve.smooth:
        bars = {"type": "data", "array": reach, "color": color, "thickness": 1, "width": 0}
        return [scatter("markers", x, y, marker={"color": color, "size": 5}, error_y=bars, **effect), points]
    # The band is filled in two parts, below and above the effect, so that the legend shows the effect on its band.
    filled = {"fill": "tonexty", "fillcolor": band}
    edge = {"hoverinfo": "skip", "showlegend": False, "line": {"width": 0}}
    return [
        points,
        scatter("lines", x, y - reach, **edge),
        scatter("lines", x, y, line={"color": color, "width": 2.2}, **filled, **effect),
        scatter("lines", x, y + reach, **edge, **filled),
    ]


def _layout(curve: EffectCurve, factor: float, unit: str) -> dict[str, Any]:
    points = np.concatenate([line.points_y for line in curve.lines])
    ends = np.concatenate([line.y + s * WIDE * line.sigma for line in curve.lines for s in (-1.0, 1.0)])
    # A few distant points must not flatten the curve.
    inner = np.quantile(points, (0.01, 0.99)) if len(points) else np.zeros(2)
    low, high = min(inner[0], float(ends.min())), max(inner[1], float(ends.max()))
    room = 0.06 * max(high - low, 1e-12)
    layout = titled(escaped(curve.x_title), "", legend={"traceorder": "normal"})
    if curve.lines[0].x.dtype == object:
        layout["xaxis"] |= {"type": "category", "automargin": "height"}
        layout["xaxis"] |= {"categoryorder": "array", "categoryarray": _texts(curve.lines[0].x)}
    layout["yaxis"] = {"range": [factor * (low - room), factor * (high + room)]}
    place = {"x": 0, "xref": "container", "yref": "container", "y": 1, "yanchor": "top", "pad": {"t": 6}}
    layout["title"] = {"text": f"{escaped(curve.name)} ({unit})", "font": {"size": 13}} | place
    layout["margin"] = {"t": 58 if len(curve.lines) == 1 else 70}  # room for a legend of two rows
    return layout
