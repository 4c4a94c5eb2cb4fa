"""Columns against which residuals are plotted, with the causes' prediction along them, and components of residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import Column as Values
from gtpin.errors import DatasetError
from gtpin.report.embedded import escaped
from gtpin.report.residuals import Residuals, fine
from gtpin.report.words import covariate_unit, travel_words, typeset, with_unit
from gtpin.typing import Floats

FEW = 8
"""Largest number of different values of a covariate that is shown by box plots."""
GROUPS = 18
"""Largest number of groups of neighbouring poses whose means are drawn."""
LEVELS = 4
"""Largest number of values of a second coordinate for which one line per value is drawn."""
LINE_SHARE = 0.5
"""Smallest fraction of the causes' power that the line must explain; with less, the causes depend more on other coordinates."""


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
    rows: npt.NDArray[np.intp]

    def left(self, layer: str) -> Floats:
        """(N,) residuals of ``before`` or ``after``."""
        return self.before if layer == "before" else self.after


@dataclass(frozen=True)
class Along:
    """The causes' prediction of residuals on a fine grid along a column, with all other coordinates held constant.

    ``x``: (m,) values of the column; NaN between two lines. ``fit``: by component, (m,): the causes' displacement, plus a
    straight line that is fitted to the rest of ``before - after`` of the residuals, because geometry absorbs a straight
    line.
    """

    x: Floats
    fit: dict[str, Floats]


@dataclass(frozen=True)
class ColumnFit:
    """A command or covariate that residuals are plotted against.

    - ``name``, ``title``: the column, and the title of its axis.
    - ``values``: (N,) its values; texts where there are few different ones, which are then shown by box plots.
    - ``order``: the few different values, in order; None for a column of numbers.
    - ``line``: the causes' prediction of the residuals along the column; None where no cause depends on it.
    """

    name: str
    title: str
    values: npt.NDArray[np.generic]
    order: tuple[str, ...] | None
    line: Along | None

    def groups(self, rows: npt.NDArray[np.intp]) -> list[npt.NDArray[np.intp]]:
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
        return max(residuals.axes, key=lambda axis: _explained(residuals, axis))
    for site in sites:
        if site in residuals.model.robot.sites:
            return site
    return max(residuals.axes, key=lambda axis: axes.get(axis, 0.0))


def _explained(residuals: Residuals, axis: str) -> float:
    """Mean square of what the causes explain of a component, in units of its noise."""
    return float(np.nanmean(residuals.component(axis, (residuals.before - residuals.after) / residuals.sigma) ** 2))


def commanded(residuals: Residuals) -> dict[str, Floats]:
    """The commands by name: q1 .. qn."""
    return {f"q{j + 1}": residuals.dataset.q[:, j] for j in range(residuals.dataset.n_actuators)}


def columns(residuals: Residuals, share: Mapping[str, float], causes: bool) -> list[ColumnFit]:
    """Each command and covariate that varies: first those on which a cause depends, then those with the strongest correlation.

    ``share``: strength of the residuals' correlation with each, by name. ``causes``: whether there are causes.
    """
    varying = [name for name, values in residuals.dataset.covariates.items() if bool((values != values[0]).any())]
    found = [column(residuals, name, causes) for name in (*commanded(residuals), *varying)]
    return sorted(found, key=lambda one: (one.line is None, -share.get(one.name, 0.0)))


def column(residuals: Residuals, name: str, causes: bool = True) -> ColumnFit:
    """A command (``q1``) or covariate.

    Raises `DatasetError` if the dataset has no such column.
    """
    known = {**commanded(residuals), **residuals.dataset.covariates}
    if name not in known:
        raise DatasetError("this column is not there", column=name, hint=f"there are {', '.join(known)}")
    values = known[name]
    number = name[1:] if name.startswith("q") else ""
    turns = number.isdigit() and residuals.model.robot.actuators[int(number) - 1].revolute
    title = escaped(with_unit(name, covariate_unit(name, turns)))
    if name != "session" and len(np.unique(values.astype(float))) > FEW:
        return ColumnFit(name, title, values, None, fit_along(residuals, name) if causes else None)
    words = [escaped(str(v) if name == "session" else typeset(f"{float(v):g}")) for v in values.tolist()]
    order = dict.fromkeys(words[i] for i in np.argsort(values, kind="stable"))
    return ColumnFit(name, title, np.array(words, dtype=object), tuple(order), None)


def fit_along(residuals: Residuals, name: str) -> Along | None:
    """The causes' line along a numeric column; None if no cause depends on it, or depends more on another coordinate.

    If they also depend on a coordinate with few values, such as a direction of approach, there is one line for each value.
    """
    model, column = residuals.model, residuals.column(name)
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
    for c in residuals.component_names:
        taken = residuals.component(c, residuals.before - residuals.after - seen)
        slope, level = np.polyfit(data, taken, 1)
        straight = slope * grid + level
        lines = [
            residuals.component(c, line, by_command) + straight for line, by_command in zip(made, moved, strict=True)
        ]
        fit[c] = np.concatenate([part for line in lines for part in (line, gap)])
    return Along(np.concatenate([part for _ in levels for part in (grid, gap)]), fit)


def _made(residuals: Residuals, own: tuple[ActiveEffect, ...], q: Floats, known: Mapping[str, Values]) -> Floats:
    """(N, c) displacement of the poses by some effects alone."""
    with_them, plain = (replace(residuals.model, effects=effects) for effects in (own, ()))
    return with_them.predict(q, known).minus(plain.predict(q))[:, : residuals.components]


def _levels(
    residuals: Residuals, own: Sequence[ActiveEffect], name: str
) -> list[tuple[dict[str, object], npt.NDArray[np.bool_]]]:
    """Values of the first other coordinate on which causes depend, if they are few, and the poses of each value."""
    others = [other for e in own for other in e.effect.coordinates(residuals.model.robot, e.site) if other != name]
    for other in others:
        values = residuals.column(other)
        levels = [] if values is None else list(dict.fromkeys(values.tolist()))
        if 1 < len(levels) <= LEVELS:
            return [({other: level}, np.asarray(values == level)) for level in levels]
    return [({}, np.ones(len(residuals), dtype=bool))]
