"""Columns against which residuals are plotted, and components of residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.errors import DatasetError
from gtpin.report.embedded import escaped
from gtpin.report.fit_along import Along, fit_along
from gtpin.report.residuals import Residuals
from gtpin.report.words import covariate_unit, travel_words, typeset, with_unit
from gtpin.typing import Floats

FEW = 8
"""Largest number of different values of a covariate that is shown by box plots."""
GROUPS = 18
"""Largest number of groups of neighbouring poses whose means are drawn."""


@dataclass(frozen=True)
class View:
    """Residuals along one component.

    Parameters
    ----------
    name, title
        The component, and the title of its axis.
    before, after
        (N,) residuals of geometry alone and of geometry with the causes, in the title's unit; NaN in rows without the
        component.
    factor
        Factor from m or rad to this unit.
    rows
        Indices of the rows that have the component.
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
class Column:
    """A command or covariate that residuals are plotted against.

    Parameters
    ----------
    name, title
        The column, and the title of its axis.
    values
        (N,) its values; texts where there are few different ones, which are then shown by box plots.
    order
        The few different values, in order; None for a column of numbers.
    line
        The causes' prediction of the residuals along the column; None where no cause depends on it.
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

    Raises
    ------
    DatasetError
        If there is no such component.
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


def columns(residuals: Residuals, share: Mapping[str, float], causes: bool) -> list[Column]:
    """Each command and covariate that varies: first those on which a cause depends, then those with the strongest correlation.

    Parameters
    ----------
    share
        Strength of the residuals' correlation with each, by name.
    causes
        Whether there are causes.
    """
    varying = [name for name, values in residuals.dataset.covariates.items() if bool((values != values[0]).any())]
    found = [column(residuals, name, causes) for name in (*commanded(residuals), *varying)]
    return sorted(found, key=lambda one: (one.line is None, -share.get(one.name, 0.0)))


def column(residuals: Residuals, name: str, causes: bool = True) -> Column:
    """A command (``q1``) or covariate.

    Raises
    ------
    DatasetError
        If the dataset has no such column.
    """
    known = {**commanded(residuals), **residuals.dataset.covariates}
    if name not in known:
        raise DatasetError("this column is not there", column=name, hint=f"there are {', '.join(known)}")
    values = known[name]
    number = name[1:] if name.startswith("q") else ""
    turns = number.isdigit() and residuals.model.robot.actuators[int(number) - 1].revolute
    title = escaped(with_unit(name, covariate_unit(name, turns)))
    if name != "session" and len(np.unique(values.astype(float))) > FEW:
        return Column(name, title, values, None, fit_along(residuals, name) if causes else None)
    words = [escaped(str(v) if name == "session" else typeset(f"{float(v):g}")) for v in values.tolist()]
    order = dict.fromkeys(words[i] for i in np.argsort(values, kind="stable"))
    return Column(name, title, np.array(words, dtype=object), tuple(order), None)
