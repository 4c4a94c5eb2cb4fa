"""Whether declared noise can be true: it is compared with the noise that is estimated from the residuals of a fit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from gtpin.calibration.noise_estimator import ENOUGH
from gtpin.calibration.problem import Problem, in_frame
from gtpin.calibration.settled import Settled
from gtpin.data import Dataset, Instrument
from gtpin.distributions import chi2
from gtpin.errors import ConvergenceError, DatasetError, warn

Sigma = Literal["position_sigma", "orientation_sigma"]
Settle = Callable[[Instrument], Settled[Problem]]

SIGMAS: tuple[tuple[Sigma, slice], ...] = (("position_sigma", slice(0, 3)), ("orientation_sigma", slice(3, 6)))
"""Keys of the noise, and the components of a pose that each is of."""
SUSPECT = 0.7
"""Root mean square of the residuals over the declared sigma below which the noise is estimated for comparison. Assumed: it
only saves a second fit in clear cases."""
TWICE = 2.0
"""Declared noise over the noise that the data show from which the declared value is not used. Assumed: data
sheets give limits of two standard deviations as often as one, and less than that changes no verdict."""
OVERSTATED = 10.0
"""Declared noise over the noise that the data show from which the data are refused: no data sheet overstates the noise so much.
Assumed."""
NO_NOISE = 0.01
"""Noise, m or rad, above that of any instrument for robots: residuals of this size are not noise. Assumed."""
CHANCE = 1e-3
"""Probability, by chi-square, of residuals as small as these under the declared noise, below which the declared value is not
used. Assumed."""
UNITS: dict[Sigma, tuple[tuple[float, float, str], ...]] = {
    "position_sigma": ((250.0, 4e3, "millimetres"), (2.5e5, 4e6, "micrometres")),
    "orientation_sigma": ((25.0, 150.0, "degrees"), (250.0, 4e3, "milliradians"), (2.5e5, 4e6, "microradians")),
}
"""Ratios (a factor of four to either side of a unit's own, less for degrees) and the unit that they look like."""


def used_noise(dataset: Dataset, settled: Settled[Problem], settle: Settle) -> tuple[Settled[Problem], Instrument]:
    """The calibration with credible noise: a declared sigma that is too large is estimated instead, with a warning.

    Parameters
    ----------
    settled
        The calibration with the noise as declared.
    settle
        Function that calibrates with another description of the instrument.

    Raises
    ------
    DatasetError
        If a declared sigma is more than ten times the estimated one.
    """
    instrument = dataset.instrument
    suspects = [key for key, _ in SIGMAS if _residual_ratio(settled, instrument, key) < SUSPECT]
    if not suspects:
        return settled, instrument
    undeclared = instrument.model_copy(update=dict.fromkeys(suspects))
    again = settle(undeclared)
    wrong = [key for key in suspects if _overstated(settled, again, instrument, key)]
    if not wrong:
        return settled, instrument
    ratios = {key: getattr(instrument, key) / shown(again, key) for key in wrong}
    for key in sorted(wrong, key=lambda k: -ratios[k]):
        declared, seen = getattr(instrument, key), shown(again, key)
        text = f"{key} is {declared:.2g}, but these data show a noise of {seen:.2g}, {declared / seen:.2g} times less"
        if declared > OVERSTATED * seen:
            like = unit_like(key, declared / seen)
            hint = f"{f'it looks like {like}: ' if like else ''}give metres and radians, or leave the line out"
            raise DatasetError(text, file=_toml(dataset), column=f"instrument.{key}", hint=hint)
        warn(f"{text}: the data's own is used")
    if wrong == suspects:
        return again, undeclared
    kept = instrument.model_copy(update=dict.fromkeys(wrong))
    return settle(kept), kept


def settled_or_explained(dataset: Dataset, settle: Settle) -> Settled[Problem]:
    """Calibrate; if the fit does not converge, find out whether the reason is a declared noise that is far too small.

    Raises
    ------
    DatasetError
        If the fit converges only when the noise is estimated, and a declared sigma is less than a tenth of it.
    ConvergenceError
        If the fit does not converge for another reason.
    """
    instrument = dataset.instrument
    try:
        return settle(instrument)
    except ConvergenceError as error:
        declared = [key for key, _ in SIGMAS if getattr(instrument, key) is not None]
        if not declared:
            raise
        try:
            again = settle(instrument.model_copy(update=dict.fromkeys(declared)))
        except ConvergenceError:
            raise error from None
        small = [key for key in declared if getattr(instrument, key) * OVERSTATED < shown(again, key)]
        if not small:
            raise
        key = small[0]
        value, seen = getattr(instrument, key), shown(again, key)
        if seen > NO_NOISE:
            raise error from None
        raise DatasetError(
            f"{key} is {value:.2g}, but these data show a noise of {seen:.2g}, {seen / value:.2g} times more",
            file=_toml(dataset),
            column=f"instrument.{key}",
            hint="give metres and radians, or leave the line out",
        ) from None


def shown(settled: Settled[Problem], key: Sigma) -> float:
    """Noise per axis, m or rad, of a calibration: that of the instrument and the scatter of the machine together."""
    problem: Problem = settled.fit.problem
    point, components = settled.fit.point, problem.measured.components
    some = np.arange(len(point.poses))[:: 1 + len(point.poses) // ENOUGH]
    J = point.model.kinematics.command_jacobian(problem.measured.q[some], point.poses[some])
    noise = settled.noise.take(settled.used).take(some)
    covariance = noise.covariance(in_frame(J, point.model.frame), components)
    kind = dict(SIGMAS)[key]
    return float(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[:, kind].mean()))


def unit_like(key: Sigma, ratio: float) -> str:
    """The unit in which a sigma was probably written that is too large by ``ratio``; empty where no unit fits."""
    return next((unit for low, high, unit in UNITS[key] if low <= ratio <= high), "")


def _residual_ratio(settled: Settled[Problem], instrument: Instrument, key: Sigma) -> float:
    """Root mean square of the residuals per axis over a declared sigma; infinite where none is declared or measured."""
    declared = getattr(instrument, key)
    problem, point = settled.fit.problem, settled.fit.point
    kind = dict(SIGMAS)[key]
    if declared is None or problem.measured.components <= kind.start:
        return float(np.inf)
    left = problem.measured.minus(point.model.seen(point.poses))[:, kind]
    return float(np.sqrt((left**2).mean())) / float(declared)


def _overstated(settled: Settled[Problem], again: Settled[Problem], instrument: Instrument, key: Sigma) -> bool:
    """Whether a declared sigma is larger than the estimate by more than `TWICE`, and its residuals smaller than by chance.

    Parameters
    ----------
    settled, again
        The calibrations with the noise as declared, and with this sigma estimated.
    """
    if getattr(instrument, key) <= TWICE * shown(again, key):
        return False
    dof = settled.dof * 3.0 / settled.fit.problem.measured.components
    count = 3.0 * settled.used.sum()
    return dof >= 1.0 and bool(chi2.cdf(count * _residual_ratio(settled, instrument, key) ** 2, dof) < CHANCE)


def _toml(dataset: Dataset) -> str | None:
    return None if dataset.path is None else str(dataset.path / "dataset.toml")
