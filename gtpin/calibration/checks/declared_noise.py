"""Whether the noise that instruments declare can be true: it is compared with the noise that a fit estimates."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from gtpin.calibration.checks import limits
from gtpin.calibration.fit_state import FitState
from gtpin.calibration.robust_fit import RobustFit
from gtpin.data.names import SIGMAS as COLUMNS
from gtpin.distributions import chi2
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.readings import Readings
from gtpin.noise.estimate import ENOUGH

Sigma = Literal["position_sigma", "orientation_sigma"]
SIGMAS: tuple[tuple[Sigma, slice], ...] = (("position_sigma", slice(0, 3)), ("orientation_sigma", slice(3, 6)))
"""Keys of a tracker's noise, and the components of a pose that each is of."""


UNITS_OF_NOISE = {
    "m": ((250.0, 4e3, "millimetres"), (2.5e5, 4e6, "micrometres")),
    "rad": ((25.0, 150.0, "degrees"), (250.0, 4e3, "milliradians"), (2.5e5, 4e6, "microradians")),
}
"""Ratios of declared to real noise (a factor of four to either side of a unit's own, less for degrees), and the unit that they
look like."""


@dataclass(frozen=True)
class Declared:
    """A declared noise sigma.

    - ``group``, ``instrument``: index of its group over all instruments' sigmas, and index of the instrument.
    - ``by_row``: whether the table declares it row by row.
    - ``key``, ``value``: its key in dataset.toml, and its value, m or rad; by row: the columns, and the median.
    """

    group: int
    instrument: int
    key: str
    value: float
    by_row: bool = False


def settled_or_explained(fit: RobustFit) -> FitState:
    """Run the robust fit; if it does not converge because a declared sigma is far too small, a `DatasetError` says so.

    So small is less than a tenth of the noise that is estimated by a fit that then converges.
    """
    readings = fit.whole.measured
    declared = _declared(readings)
    try:
        return fit.run()
    except ConvergenceError as error:
        if not declared:
            raise
        try:
            again = _undeclared(fit, declared).run()
        except ConvergenceError:
            raise error from None
        for one in declared:
            seen = _shown(again, one)
            if one.value * limits.NOISE_OVERSTATED < seen:
                if seen > 0.01:  # m or rad: no instrument for robots has so much
                    raise error from None
                raise _error(readings, one, seen) from None
        raise


def with_credible_noise(fit: RobustFit, settled: FitState) -> tuple[RobustFit, FitState]:
    """The fit and its result with credible noise: a declared sigma that is too large is estimated instead, with a warning.

    One that repeated visits contradict was estimated in the fit already.

    Raises `DatasetError` if a sigma is more than ten times what the data show.
    """
    readings = fit.whole.measured
    for one in _declared(readings):
        if settled.noise.estimated[one.group]:
            what = _text(readings, one, float(settled.noise.sigma[one.group]), "repeated visits")
            if settled.noise.repeatability > 0.0:
                what += f", beside a repeatability of {settled.noise.repeatability:.2g} of each drive"
            warn(
                f"{what}, without causes: the fit of the geometry uses this noise; the declared value is wrong, or something "
                "changes between visits"
            )
    suspects = [one for one in _declared(readings) if _overstated(settled, one)]
    if not suspects:
        return fit, settled
    undeclared = _undeclared(fit, suspects)
    again = undeclared.run()
    seen = {one.group: _shown(again, one) for one in suspects}
    # Data sheets give limits of two standard deviations as often as one, and less than that changes no verdict.
    wrong = [one for one in suspects if one.value > 2.0 * seen[one.group]]
    for one in sorted(wrong, key=lambda one: seen[one.group] / one.value):
        if one.value > limits.NOISE_OVERSTATED * seen[one.group]:
            raise _error(readings, one, seen[one.group])
        warn(f"{_text(readings, one, seen[one.group])}: the noise of the data is used")
    if not wrong:
        return fit, settled
    if wrong != suspects:
        undeclared = _undeclared(fit, wrong)
        again = undeclared.run()
    return undeclared, again


def _undeclared(fit: RobustFit, declared: Collection[Declared]) -> RobustFit:
    """The fit without some of the declared sigmas."""
    readings = fit.whole.measured
    rows = readings.rows
    tables, columns = list(rows.tables), dict(rows.columns)
    for one in declared:
        if one.by_row:
            mine = rows.of == one.instrument
            columns |= {name: np.where(mine, np.nan, columns[name]) for name in COLUMNS if name in columns}
            continue
        blank = {"position_sigma": None, "sigma": None} if one.key == "position_sigma" else {one.key: None}
        tables[one.instrument] = tables[one.instrument].model_copy(update=blank)
    readings = replace(readings, rows=replace(rows, tables=tuple(tables), columns=columns))
    return replace(fit, whole=replace(fit.whole, measured=readings))


def _declared(readings: Readings) -> list[Declared]:
    """The declared sigmas, of groups whose rows all declare their own, or none does."""
    found, group = [], 0
    own = set(np.unique(readings.group[~np.isfinite(readings.row_sigma)]).tolist())
    for i, one in enumerate(readings.instruments):
        for k, value in enumerate(one.declared):
            keys = ("position_sigma", "sigma") if k == 0 else ("orientation_sigma",)
            key = next((key for key in keys if getattr(one.table, key, None) is not None), None)
            columns = COLUMNS[3 * k : 3 * k + 3]
            if group not in own and set(columns) <= set(one.read.numbers):
                middle = float(np.median(readings.row_sigma[readings.group == group]))
                found.append(Declared(group, i, " ".join(columns), middle, by_row=True))
            elif value is not None and key is not None and group in own:
                found.append(Declared(group, i, key, value))
            group += 1
    return found


def _shown(settled: FitState, one: Declared) -> float:
    """Noise of the numbers of a group, m or rad, of a fit: that of the instrument and the scatter of the machine together."""
    problem, point = settled.fit.problem, settled.fit.point
    some = np.flatnonzero((problem.measured.group == one.group).any(axis=1))
    some = some[:: 1 + len(some) // ENOUGH]
    noise = settled.noise.take(settled.used).take(some)
    covariance = noise.covariance(problem.by_command(point, some), problem.measured.components)
    own = problem.measured.group[some] == one.group
    return float(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[own].mean()))


def _overstated(settled: FitState, one: Declared) -> bool:
    """Whether residuals are smaller than a declared sigma, and by chi-square no accident if it were true."""
    fit, readings = settled.fit, settled.fit.problem.measured
    own = (readings.group == one.group) & (np.isfinite(readings.row_sigma) == one.by_row)
    sigma = readings.row_sigma[own] if one.by_row else one.value
    residual = fit.problem.raw_residual(fit.point, fit.point.poses)[own] / sigma
    if not residual.size or (residual**2).mean() >= 0.7**2:
        return False
    effective_parameters = 0.0
    for rows in fit.problem.chunks():
        J = fit.problem.jacobian(fit.point, rows, fit.weight[rows])
        leverage = np.einsum("nci,ij,ncj->nc", J, fit.covariance, J, optimize=True)
        effective_parameters += float(leverage[readings.group[rows] == one.group].sum())
    free = residual.size - effective_parameters
    return free >= 1.0 and bool(chi2.cdf(float((residual**2).sum()), free) < 1e-3)  # too few say nothing of noise


def _text(readings: Readings, one: Declared, seen: float, what: str = "these data") -> str:
    ratio, name = one.value / seen, readings.instruments[one.instrument].name
    times = f"{ratio:.2g} times less" if ratio > 1.0 else f"{1.0 / ratio:.2g} times more"
    of, verb = f"{one.key} of {name}" if name else one.key, "are" if one.by_row else "is"
    return f"{of} {verb} {one.value:.2g}, but {what} show a noise of {seen:.2g}, {times}"


def _error(readings: Readings, one: Declared, seen: float) -> DatasetError:
    """The error of a sigma that is more than ten times too large or too small; a unit that it looks like is named."""
    file = readings.rows.files[one.instrument]
    what, lines = (
        "columns" if one.by_row else "line",
        UNITS_OF_NOISE["rad" if readings.group_turns[one.group] else "m"],
    )
    like = next((unit for low, high, unit in lines if low <= one.value / seen <= high), "")
    hint = f"{f'it looks like {like}: ' if like else ''}give metres and radians, or leave the {what} out"
    column = one.key
    if not one.by_row:
        file = None if file is None else Path(file).parent / "dataset.toml"
        number = f"{one.instrument}." if readings.rows.names else ""
        column = f"instrument.{number}{one.key}"
    return DatasetError(_text(readings, one, seen), file=file, column=column, hint=hint)
