"""The causes' prediction of residuals along a column, with all other coordinates held constant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import Column
from gtpin.report.residuals import Residuals, fine
from gtpin.typing import Floats

LEVELS = 4
"""Largest number of values of a second coordinate for which one line per value is drawn."""
LINE_SHARE = 0.5
"""Smallest fraction of the causes' power that the line must explain; with less, the causes depend more on other coordinates."""


@dataclass(frozen=True)
class Along:
    """The causes' prediction of residuals on a fine grid along a column, with all other coordinates held constant.

    Parameters
    ----------
    x
        (m,) values of the column; NaN between two lines.
    fit
        By component, (m,): the causes' displacement, plus a straight line that is fitted to the rest of ``before - after`` of
        the residuals, because geometry absorbs a straight line.
    """

    x: Floats
    fit: dict[str, Floats]


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


def _made(residuals: Residuals, own: tuple[ActiveEffect, ...], q: Floats, known: Mapping[str, Column]) -> Floats:
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
