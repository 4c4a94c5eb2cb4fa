"""Curves of an effect with their 95 % bands: a track's straightness, a rack's periodic error, a drift."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import Situation
from gtpin.estimate import WIDE
from gtpin.report.effect_motions import Motion, motions
from gtpin.report.residuals import Residuals, fine
from gtpin.report.words import coordinate_words, covariate_unit, typeset, with_unit
from gtpin.typing import Floats


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
    - ``categories``: whether x is text.
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
    categories: bool = False
    lever: float | None = None

    @property
    def seen(self) -> bool:
        """Whether it differs from zero by more than its band anywhere."""
        return any(bool((np.abs(line.y) > WIDE * line.sigma).any()) for line in self.lines)

    @property
    def range(self) -> float:
        """Difference between its highest and its lowest point, m or rad."""
        return float(max(line.y.max() for line in self.lines) - min(line.y.min() for line in self.lines))


@dataclass(frozen=True)
class _Level:
    label: str
    at: Situation
    x: npt.NDArray[np.generic]
    rows: npt.NDArray[np.intp]


def curves(active: ActiveEffect, residuals: Residuals) -> tuple[EffectCurve, ...]:
    """The curves of an effect, one for every quantity that it displaces.

    If the effect depends on a coordinate that can be varied alone (a command, time, a temperature), the curve is along this
    coordinate, with all others at their means or medians. If it depends on forces, directions or positions, it is shown at the
    measured poses.
    """
    own = _own_coordinates(active, residuals)
    name, levels = _levels(active, residuals, own)
    if levels:
        return _swept(active, residuals, name, levels)
    return _at_the_poses(active, residuals, own)


def _own_coordinates(active: ActiveEffect, residuals: Residuals) -> tuple[str, ...]:
    return active.effect.coordinates(residuals.model.robot, active.site)


def _levels(active: ActiveEffect, residuals: Residuals, own: tuple[str, ...]) -> tuple[str, list[_Level]]:
    """Name of the coordinate along which curves are drawn, and situations along it, one for each value of a second
    coordinate."""
    if not own or own[0] in ("load", "direction", "position"):
        return "", []
    if "session" in own:
        return "session", [_sessions(active, residuals)]
    known = [name for name in own if _column(residuals, name) is not None]
    swept = [name for name in known if not name.startswith("approach")]
    if not swept:
        return "", []
    if active.site in residuals.model.robot.sites and len(swept) == residuals.model.robot.n_actuators > 1:
        swept.sort(key=lambda name: name == _command_of(active, residuals))  # commands of other actuators first
    first = swept[0]
    others = [name for name in known if name != first]
    data = _column(residuals, first)
    assert data is not None
    grid = fine(data, active.effect.has_nonlinear)
    if not others:
        return first, [_Level("", _situation(active, residuals, {first: grid}), grid, np.arange(len(residuals)))]
    other = others[0]
    values = _column(residuals, other)
    assert values is not None
    steps = [-1.0, 1.0] if other.startswith("approach") else np.quantile(values, (0.1, 0.9)).tolist()
    nearest = np.abs(values[:, None] - np.array(steps)).argmin(axis=1)
    unit = covariate_unit(other, _angular(residuals, other))
    return first, [
        _Level(
            typeset(f"{other} = {step:.3g} {unit}".rstrip()),
            _situation(active, residuals, {first: grid, other: np.full(len(grid), step)}),
            grid,
            np.flatnonzero(nearest == k),
        )
        for k, step in enumerate(steps)
    ]


def _sessions(active: ActiveEffect, residuals: Residuals) -> _Level:
    known = np.array(active.references.sessions, dtype=object)
    at = _situation(active, residuals, {"session": known})
    return _Level("", at, known, np.arange(len(residuals)))


def _command_of(active: ActiveEffect, residuals: Residuals) -> str:
    return f"q{residuals.model.robot.sites.index(active.site) + 1}"


def _column(residuals: Residuals, name: str) -> Floats | None:
    """A command or numeric covariate; None where the dataset does not have it."""
    values = residuals.column(name)
    return None if values is None or name == "session" else np.asarray(values, dtype=float)


def _angular(residuals: Residuals, name: str) -> bool:
    word = name.rstrip("0123456789")
    number = name[len(word) :]
    return word in ("q", "speed") and bool(number) and residuals.model.robot.actuators[int(number) - 1].revolute


def _situation(active: ActiveEffect, residuals: Residuals, given: Mapping[str, npt.NDArray[np.generic]]) -> Situation:
    """Situations with some given coordinates and usual values for the others."""
    return residuals.at(*residuals.middle(given), active.references)


def _swept(active: ActiveEffect, residuals: Residuals, x_name: str, levels: list[_Level]) -> tuple[EffectCurve, ...]:
    found = []
    at_poses = {motion.name: motion for motion in motions(active, _measured(active, residuals))}
    by_level = [{motion.name: motion for motion in motions(active, level.at)} for level in levels]
    for name, first in by_level[0].items():
        if name not in at_poses or any(name not in level for level in by_level):
            continue
        parts = [level[name].columns for level in by_level]
        straightened = first.straightened and len(levels) == 1 and x_name.startswith("q")
        parts = _less_geometry(parts, np.asarray(levels[0].x, dtype=float) if straightened else None)
        left = residuals.along(residuals.after, at_poses[name].tcp)
        lines = []
        for level, columns in zip(levels, parts, strict=True):
            y, sigma = _with_sigma(active, columns)
            x = _x_of(residuals, x_name)[level.rows]
            lines.append(CurveLine(level.label, level.x, y, sigma, x, _between(level.x, y, x) + left[level.rows]))
        title = with_unit(coordinate_words(x_name), covariate_unit(x_name, _angular(residuals, x_name)))
        sessions = x_name == "session"
        lever = _lever(residuals, at_poses[name])
        found.append(EffectCurve(name, first.unit, title, tuple(lines), not sessions, straightened, sessions, lever))
    return tuple(found)


def _at_the_poses(active: ActiveEffect, residuals: Residuals, own: tuple[str, ...]) -> tuple[EffectCurve, ...]:
    at = _measured(active, residuals)
    found = []
    for number, motion in enumerate(motions(active, at)):
        (columns,) = _less_geometry([motion.columns], None)
        y, sigma = _with_sigma(active, columns)
        left, lever = residuals.along(residuals.after, motion.tcp), _lever(residuals, motion)
        for x_name, unit, x in _places(active, at, motion, number, own):
            order = np.argsort(x, kind="stable")
            line = CurveLine("", x[order], y[order], sigma[order], x[order], (y + left)[order])
            found.append(
                EffectCurve(motion.name, motion.unit, with_unit(x_name, unit), (line,), smooth=False, lever=lever)
            )
    return tuple(found)


def _places(
    active: ActiveEffect, at: Situation, motion: Motion, number: int, own: tuple[str, ...]
) -> list[tuple[str, str, Floats]]:
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
    robot = residuals.model.robot
    return None if robot.rods else float(np.linalg.norm(motion.tcp[:, :3], axis=1).mean())


def _measured(active: ActiveEffect, residuals: Residuals) -> Situation:
    return residuals.at(residuals.dataset.q, residuals.dataset.covariates, active.references)


def _x_of(residuals: Residuals, name: str) -> npt.NDArray[np.generic]:
    if name == "session":
        return np.array([str(s) for s in residuals.dataset.covariates["session"]], dtype=object)
    column = _column(residuals, name)
    assert column is not None
    return column


def _between(x: npt.NDArray[np.generic], y: Floats, at: npt.NDArray[np.generic]) -> Floats:
    """A curve interpolated between its points, or its value at a session."""
    if x.dtype == object:
        value = dict(zip(x.tolist(), y.tolist(), strict=True))
        return np.array([value[one] for one in at.tolist()])
    return np.asarray(np.interp(at.astype(float), x.astype(float), y))


def _less_geometry(parts: list[Floats], x: Floats | None) -> list[Floats]:
    """Columns without the part that geometry absorbs: their mean over all parts, and a straight line over x if x is given."""
    whole = np.vstack(parts)
    taken = np.ones((len(whole), 1)) if x is None else np.stack([np.ones(len(x)), x - x.mean()], axis=1)
    left = whole - taken @ np.linalg.lstsq(taken, whole, rcond=None)[0]
    return np.split(left, np.cumsum([len(part) for part in parts])[:-1])


def _with_sigma(active: ActiveEffect, columns: Floats) -> tuple[Floats, Floats]:
    variance = np.einsum("nm,mk,nk->n", columns, active.covariance, columns)
    return columns @ active.coefficients, np.sqrt(np.maximum(variance, 0.0))
