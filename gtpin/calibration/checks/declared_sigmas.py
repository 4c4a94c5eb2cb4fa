"""Whether the noise that instruments declare can be true: it is compared with the noise that a fit estimates."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gtpin.calibration.checks.declared_noise import CHANCE, NO_NOISE, OVERSTATED, SUSPECT, TWICE
from gtpin.calibration.readings_problem import ReadingsProblem
from gtpin.calibration.robust_fit import RobustFit
from gtpin.calibration.settled import Settled
from gtpin.data.read_instruments import SIGMAS
from gtpin.distributions import chi2
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.readings import Readings
from gtpin.typing import Floats


@dataclass(frozen=True)
class Declared:
    """A declared noise sigma.

    Parameters
    ----------
    group, instrument
        Index of its group over all instruments' sigmas, and index of the instrument.
    key
        Its key in dataset.toml; for sigmas that a table declares row by row, the columns.
    value
        Its value, m or rad; for sigmas by row, their median.
    by_row
        Whether the table declares it row by row.
    """

    group: int
    instrument: int
    key: str
    value: float
    by_row: bool = False


def settled_with_sigmas(fit: RobustFit) -> Settled[ReadingsProblem]:
    """The robust fit with credible noise: a declared sigma that is too large is estimated instead, with a warning.

    Raises
    ------
    DatasetError
        If a sigma is more than ten times what the data show; or less than a tenth of it, so that no fit converges.
    ConvergenceError
        If the fit does not converge for another reason.
    """
    readings = _readings(fit)
    declared = _declared(readings)
    try:
        settled = fit.run()
    except ConvergenceError as error:
        if not declared:
            raise
        _explain(fit, declared, error)
        raise
    suspects = [one for one in declared if _ratio(settled, one) < SUSPECT and _chance(settled, one) < CHANCE]
    if not suspects:
        return settled
    again = _undeclared(fit, suspects).run()
    wrong = [one for one in suspects if one.value > TWICE * again.noise.sigma[one.group]]
    for one in sorted(wrong, key=lambda one: again.noise.sigma[one.group] / one.value):
        seen = float(again.noise.sigma[one.group])
        if one.value > OVERSTATED * seen:
            raise _error(_readings(fit), one, seen)
        warn(f"{_text(readings, one, seen)}: the data's own is used")
    if not wrong:
        return settled
    return again if wrong == suspects else _undeclared(fit, wrong).run()


def _readings(fit: RobustFit) -> Readings:
    assert isinstance(fit.whole, ReadingsProblem)
    return fit.whole.readings


def _undeclared(fit: RobustFit, declared: Collection[Declared]) -> RobustFit:
    """The fit without some of the declared sigmas."""
    assert isinstance(fit.whole, ReadingsProblem)
    return replace(fit, whole=replace(fit.whole, readings=_without(fit.whole.readings, declared)))


def _declared(readings: Readings) -> list[Declared]:
    """The declared sigmas, of groups whose rows all declare their own, or none does."""
    found, group = [], 0
    own = set(readings.group[~np.isfinite(readings.row_sigma)].tolist())
    for i, one in enumerate(readings.instruments):
        for k, value in enumerate(one.declared):
            keys = ("position_sigma", "sigma") if k == 0 else ("orientation_sigma",)
            key = next((key for key in keys if getattr(one.table, key, None) is not None), None)
            columns = SIGMAS[3 * k : 3 * k + 3]
            if group not in own and set(columns) <= set(one.read.numbers):
                middle = float(np.median(readings.row_sigma[readings.group == group]))
                found.append(Declared(group, i, " ".join(columns), middle, by_row=True))
            elif value is not None and key is not None and group in own:
                found.append(Declared(group, i, key, value))
            group += 1
    return found


def _without(readings: Readings, declared: Collection[Declared]) -> Readings:
    """The readings without some of the declared sigmas."""
    rows = readings.rows
    tables, columns = list(rows.tables), dict(rows.columns)
    for one in declared:
        if one.by_row:
            mine = rows.of == one.instrument
            columns |= {name: np.where(mine, np.nan, columns[name]) for name in SIGMAS if name in columns}
            continue
        blank = {"position_sigma": None, "sigma": None} if one.key == "position_sigma" else {one.key: None}
        tables[one.instrument] = tables[one.instrument].model_copy(update=blank)
    return replace(readings, rows=replace(rows, tables=tuple(tables), columns=columns))


def _explain(fit: RobustFit, declared: list[Declared], error: ConvergenceError) -> None:
    """Raise where the fit converges only with noise that is estimated, far larger than what is declared."""
    try:
        again = _undeclared(fit, declared).run()
    except ConvergenceError:
        raise error from None
    for one in declared:
        seen = float(again.noise.sigma[one.group])
        if one.value * OVERSTATED < seen < NO_NOISE:
            raise _error(_readings(fit), one, seen) from None


def _own(settled: Settled[ReadingsProblem], one: Declared) -> Floats:
    """Residuals of the numbers with this declared sigma, in units of it."""
    problem, point = settled.fit.problem, settled.fit.point
    readings = problem.readings.at(problem.unknowns(point.x))
    sigma = np.where(
        np.isfinite(readings.row_sigma) == one.by_row, readings.row_sigma if one.by_row else one.value, np.nan
    )
    own = (readings.group == one.group) & np.isfinite(sigma)
    return np.asarray(readings.minus(point.poses)[own] / sigma[own])


def _ratio(settled: Settled[ReadingsProblem], one: Declared) -> float:
    """Root mean square of the residuals over a declared sigma."""
    left = _own(settled, one)
    return float(np.sqrt((left**2).mean())) if left.size else np.inf


def _chance(settled: Settled[ReadingsProblem], one: Declared) -> float:
    """Probability, by chi-square, of residuals as small as these if the declared sigma is true."""
    fit, left = settled.fit, _own(settled, one)
    taken = 0.0
    for rows in fit.problem.chunks():
        J = fit.problem.jacobian(fit.point, rows, fit.weight[rows])
        own = fit.problem.readings.group[rows] == one.group
        taken += float(np.einsum("nci,ij,ncj->nc", J, fit.covariance, J, optimize=True)[own].sum())
    free = left.size - taken
    return float(chi2.cdf(float((left**2).sum()), free)) if free >= 1.0 else 1.0  # too few say nothing of noise


def _text(readings: Readings, one: Declared, seen: float) -> str:
    ratio = one.value / seen
    times = f"{ratio:.2g} times less" if ratio > 1.0 else f"{1.0 / ratio:.2g} times more"
    name = readings.instruments[one.instrument].name
    verb = "are" if one.by_row else "is"
    return f"{one.key} of {name} {verb} {one.value:.2g}, but these data show a noise of {seen:.2g}, {times}"


def _error(readings: Readings, one: Declared, seen: float) -> DatasetError:
    file = readings.rows.files[one.instrument]
    if one.by_row:
        hint = "give metres and radians, or leave the columns out"
        return DatasetError(_text(readings, one, seen), file=file, column=one.key, hint=hint)
    toml = None if file is None else Path(file).parent / "dataset.toml"
    hint = "give metres and radians, or leave the line out"
    return DatasetError(
        _text(readings, one, seen), file=toml, column=f"instrument.{one.instrument}.{one.key}", hint=hint
    )
