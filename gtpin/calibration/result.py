"""The result of a calibration: values with sigmas, variance reduction, observability, and quality of the fit."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.noise_estimator import noise_at
from gtpin.calibration.observability import Direction, Observability, Remedy, of_geometry, with_priors
from gtpin.calibration.regressor import BaseParameter, Regressor, base_parameters, regressor
from gtpin.data import Dataset, InstrumentSection
from gtpin.errors import renamed
from gtpin.estimate import Estimate
from gtpin.instruments.instrument import Unknown
from gtpin.model.departures import Zero, equivalent_zeros
from gtpin.model.model import Model
from gtpin.noise.estimate import ENOUGH
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.output.shown import FitResult, present
from gtpin.typing import Floats, Mask

WORSE = 1.05
"""Error of the calibrated robot over that of the nominal one from which the fit counts as worse. Assumed: noise, which a
fit divides otherwise between positions and orientations, changes less."""
CORRELATED = 0.7
"""Smallest absolute correlation of two parameters that is listed."""


@dataclass(frozen=True)
class InstrumentFit:
    """How well a calibration fits the readings of one instrument.

    - ``name``, ``kind``: as in dataset.toml; the name of a single tracker may be empty. It then has a second one of these,
      for its orientations.
    - ``readings``: number of used rows of its table.
    - ``before``, ``after``: root mean square error of its readings, in ``unit``. ``before``: of the nominal robot with the
      values of the instrument's unknowns, and of its frame where that is free, that make these errors smallest (of a single
      tracker: the errors of positions). ``after``: of the calibrated robot. For positions and orientations: of the
      length of the error vector.
    - ``floor``: the root mean square error that noise alone would leave, in ``unit``.
    - ``unit``: ``m`` or ``rad``.
    - ``left_out``: the root mean square error of its readings, in ``unit``, each pose predicted by a fit without it (see
      :func:`~gtpin.calibration.left_out.left_out`). What the other poses do not determine counts as 0.
    """

    name: str
    kind: str
    readings: int
    before: float
    after: float
    floor: float
    unit: str
    left_out: float

    @property
    def what(self) -> str:
        """What the error is of, in words: of a tracker's poses where nothing else was measured, else of the instrument."""
        return f"error of {self.name}" if self.name else {"m": "position error", "rad": "orientation error"}[self.unit]

    def to_json(self) -> dict[str, Any]:
        """As in ``calibration.json``."""
        return {
            "rms_before": self.before,
            "rms_after": self.after,
            "rms_left_out": self.left_out,
            "noise_floor": self.floor,
            "unit": self.unit,
        }


class Iteration(NamedTuple):
    """A step of a fit: the name of the fit, the number of the step in it, and the RMS residual in sigmas of its noise."""

    fit: str
    number: int
    rms: float


@dataclass(frozen=True, repr=False)
class Calibration(FitResult):
    """A calibrated model with its uncertainty and the quality of the fit.

    Parameters
    ----------
    model
        The model with the identified geometry. It predicts poses.
    covariance
        (p, p) posterior covariance of the geometry's parameters, m, rad and m/m, in the order of ``names``.
    observability
        Variance reduction along the principal directions of the parameter space, and observability indices.
    noise
        Noise of the measurements, declared or estimated: one sigma for each of ``sigmas``.
    sigmas
        Name of the instrument and unit (``m`` or ``rad``) of each of the noise's sigmas.
    sigma_scale
        Ratio of the poses' mean residuals to the noise of such means where chi-square shows a lack of fit, else 1.
        ``covariance`` includes it already: it is computed with the noise multiplied by this ratio.
    freedom
        Degrees of freedom of the Student t distribution of the noise; infinite for Gaussian noise.
    poses, rejected
        Number of used rows, and the ids of poses with rows that were rejected as outliers.
    rejected_rows
        Line numbers of the rejected rows in their file. Other rows of the same pose may be used.
    chi2, dof
        Sum of squares of the whitened residuals; measured components minus effective number of parameters.
    iterations
        Number of Gauss-Newton steps, summed over the fits of the robust reweighting.
    residual
        (poses, c) measured less predicted of the used rows, m and rad: of a tracker's poses in its frame (c = 3 or 6), or of
        other readings. Where instruments read several numbers, each number has a row (c = 1).
    residual_before
        The same for the nominal geometry.
    instrument
        The dataset's instrument. A declared value that the data contradict is left out: it is estimated instead.
    dataset
        The input data.
    by_instrument
        Errors of each instrument.
    unknowns
        The k unknowns of the instruments.
    u, u_covariance
        (k,) identified values of the unknowns less their declared values, m or rad, and the (k, k) covariance.
    remedies
        For each unobservable direction, the measurement that would show it; None where none is known.
    fit
        The last fit. Its ``point.x`` has the unknowns in units of their priors.
    row_poses
        (N,) ids of the poses of the rows of ``fit``.
    history
        All iterations, in order.
    paper_model
        Number of the paper's model 1 to 5 whose parameters these are; None for the default parameters.
    warnings
        Texts of all warnings, also of those when the dataset was read.

    Examples
    --------
    >>> import gtpin
    >>> calibration = gtpin.calibrate(gtpin.Dataset.read("measured"))
    >>> length = calibration["length[2a]"]
    >>> low, high = length.interval
    >>> low < length.value < high
    True
    >>> calibration.to_dataframe().loc["length[2a]", "unit"]
    'm'
    """

    model: Model
    covariance: Floats
    observability: Observability
    noise: ReadingNoise
    sigmas: tuple[tuple[str, str], ...]
    sigma_scale: float
    freedom: float
    poses: int
    rejected: tuple[str, ...]
    rejected_rows: tuple[int, ...]
    chi2: float
    dof: float
    iterations: int
    residual: Floats
    residual_before: Floats
    instrument: InstrumentSection
    dataset: Dataset
    by_instrument: tuple[InstrumentFit, ...]
    fit: Fit
    row_poses: tuple[str, ...]
    unknowns: tuple[Unknown, ...] = ()
    u: Floats = field(default_factory=lambda: np.zeros(0))
    u_covariance: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    remedies: tuple[Remedy | None, ...] = ()
    history: tuple[Iteration, ...] = ()
    paper_model: int | None = None
    warnings: tuple[str, ...] = ()

    def used(self, dataset: Dataset) -> Mask:
        """(N,) mask: True for the rows of ``dataset`` that the calibration used, False for outliers.

        ``dataset`` is the calibrated one or a part of it: rows are recognised by their line numbers.
        """
        return ~np.isin(dataset.row, self.rejected_rows)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p parameters of the geometry."""
        return self.model.geometry.names

    @property
    def values(self) -> Floats:
        """(p,) identified values of the parameters, m, rad or m/m."""
        return self.model.geometry.values

    @cached_property
    def sigma(self) -> Floats:
        """(p,) standard deviations of the parameters, m, rad or m/m."""
        return np.sqrt(np.diag(self.covariance))

    learned = renamed("learned", "variance_reduction")
    enlarged = renamed("enlarged", "sigma_scale")

    @cached_property
    def variance_reduction(self) -> Floats:
        """(p,) Variance reduction 1 - (sigma / tolerance)^2: 0 if the data give no information on a parameter."""
        return np.asarray(1.0 - (self.sigma / self.model.geometry.tolerance) ** 2)

    @cached_property
    def correlation(self) -> Floats:
        """(p, p) correlations of the parameters."""
        return np.asarray(self.covariance / np.outer(self.sigma, self.sigma))

    @property
    def unobservable(self) -> tuple[Direction, ...]:
        """Directions in parameter space with a variance reduction below 0.5, the smallest first."""
        return self.observability.unobservable(self.names)

    @property
    def words(self) -> tuple[str, ...]:
        """A sentence for each unobservable direction."""
        words: tuple[str, ...] = present(self).unseen()
        return words

    @property
    def noise_known(self) -> bool:
        """Whether the noise was declared, or shown by repeated visits, and not taken from the residuals; of poses of one
        tracker that of the positions."""
        return self.noise.known

    @property
    def assumed_turn(self) -> float | None:
        """The noise of a tracker's orientations, rad, where it was taken from the residuals beside the known one of the
        positions; else None."""
        assumed = self.noise_known and self.noise.source == "residuals"
        return self.noise.orientation_sigma if assumed else None

    @cached_property
    def drive_scatter(self) -> float:
        """Scatter of what is measured by the repeatability of the drives, over the noise of the instruments: the median over
        the rows, of a pose over the axes of its position; 0 where the drives show none."""
        if self.noise.repeatability == 0.0:
            return 0.0
        problem, point = self.fit.problem, self.fit.point
        some = np.arange(len(point.poses))[:: 1 + len(point.poses) // ENOUGH]
        moved = np.sqrt((problem.by_command(point, some) ** 2).sum(axis=2))[:, :3]
        sigma = noise_at(self.noise, problem.measured.take(some)).each[:, : moved.shape[1]]
        return float(np.median(self.noise.repeatability * moved / sigma))

    def shows_noise(self, one: InstrumentFit) -> bool:
        """Whether the noise floor of an instrument's errors is of known noise, and not of the residuals."""
        return self.noise_known and (one.unit != "rad" or self.assumed_turn is None)

    @property
    def worse(self) -> str:
        """Which errors are larger than those of the nominal robot, in words; empty where none is."""
        larger = [one for one in self.by_instrument if one.after > WORSE * one.before]
        sizes = [f"{one.what} from {1e6 * one.before:.0f} to {1e6 * one.after:.0f} u{one.unit}" for one in larger]
        return f"the fit makes the {' and the '.join(sizes)}: don't use this model" if sizes else ""

    @property
    def explained(self) -> bool:
        """Whether the residuals show no lack of fit; otherwise the geometry alone does not explain the data."""
        return self.sigma_scale <= 1.0

    @cached_property
    def zeros(self) -> tuple[Zero, ...]:
        """For each actuator that carries rods: the shift of its zero that is equivalent to the shifts of its joints."""
        return equivalent_zeros(self.model.geometry, self.covariance)

    @cached_property
    def regressor(self) -> Regressor:
        """The stacked, whitened Jacobian of the last fit with the names of its rows and columns."""
        return regressor(self.fit, self.row_poses)

    @cached_property
    def base_parameters(self) -> tuple[BaseParameter, ...]:
        """The sums of parameters that the data determine, where they do not determine all parameters one by one."""
        geometry = self.model.geometry
        return base_parameters(of_geometry(with_priors(self.fit), len(self.names)), geometry, self.covariance)

    @property
    def chi2_per_dof(self) -> float:
        """Chi-square per degree of freedom: 1 for a model that fits data whose noise is known."""
        return self.chi2 / self.dof

    def __getitem__(self, name: str) -> Estimate:
        """One parameter's value and sigma, by its name, sigma 0 of one that was held; `ModelError` where none has this name."""
        value = self.model.geometry[name]
        if name not in self.names:
            return Estimate(value, 0.0, next(p.unit for p, _ in self.model.geometry.held if p.name == name))
        index = self.names.index(name)
        return Estimate(value, float(self.sigma[index]), self.model.geometry.parameters[index].unit)

    def unknown(self, name: str) -> Estimate:
        """Value and sigma of one of the instruments' unknowns, by its name."""
        index = [one.name for one in self.unknowns].index(name)
        sigma = float(np.sqrt(self.u_covariance[index, index]))
        one = self.unknowns[index]
        return Estimate(one.nominal + float(self.u[index]), sigma, one.unit)

    def correlated(self, least: float = CORRELATED) -> list[tuple[str, str, float]]:
        """Pairs of parameters with an absolute correlation of at least ``least``, the strongest first.

        Each entry is (name, name, correlation).
        """
        i, j = np.triu_indices(len(self.names), 1)
        rho = self.correlation[i, j]
        order = [k for k in np.argsort(-np.abs(rho), kind="stable") if abs(rho[k]) >= least]
        return [(self.names[i[k]], self.names[j[k]], float(rho[k])) for k in order]

    def to_json(self) -> dict[str, Any]:
        """The content of ``calibration.json``; the instruments' unknowns are listed after the geometry's parameters."""
        found = (column.tolist() for column in (self.values, self.sigma, self.variance_reduction))
        parameters = [
            (p.name, value, sigma, p.unit, p.nominal, p.tolerance, reduction)
            for p, value, sigma, reduction in zip(self.model.geometry.parameters, *found, strict=True)
        ]
        for one in self.unknowns:
            own, prior = self.unknown(one.name), one.sigma if np.isfinite(one.sigma) else None
            reduction = 1.0 if prior is None else 1.0 - (own.sigma / prior) ** 2
            parameters.append((one.name, own.value, own.sigma, one.unit, one.nominal, prior, reduction))
        keys = ("name", "value", "sigma", "unit", "nominal", "tolerance", "learned")
        unseen = zip(self.unobservable, self.words, strict=True)
        return {
            "schema": "gtpin-calibration/1",
            "model": "default" if self.paper_model is None else self.paper_model,
            "poses": self.poses,
            "rows": self.dataset.rows_used,
            "rejected": list(self.rejected),
            **_errors_json(self),
            "chi2_per_dof": self.chi2_per_dof,
            "iterations": self.iterations,
            "parameters": [dict(zip(keys, row, strict=True)) for row in parameters],
            "held": {p.name: value for p, value in self.model.geometry.held},
            "unobservable": [
                {"direction": d.weights, "learned": d.variance_reduction, "words": words} for d, words in unseen
            ],
            "equivalent_zeros": [asdict(zero) for zero in self.zeros],
            "correlations": [{"a": a, "b": b, "rho": rho} for a, b, rho in self.correlated()],
            "observability": self.observability.indices,
            "degrees_of_freedom": self.dof,
            "noise": _noise_json(self),
            "by_instrument": {one.name: one.to_json() for one in self.by_instrument if one.name},
            "warnings": list(self.warnings),
        }


def _errors_json(c: Calibration) -> dict[str, float | None]:
    """Errors of the first tracker's positions and orientations; None without them."""
    found: dict[str, float | None] = {}
    for what, unit in (("position", "m"), ("orientation", "rad")):
        one = next((one for one in c.by_instrument if one.kind == "tracker" and one.unit == unit), None)
        for key, name in (("rms_before", "before"), ("rms_after", "after"), ("rms_left_out", "left_out")):
            found[f"{what}_{key}"] = getattr(one, name, None)
        found[f"{what}_noise_floor"] = one.floor if one and c.shows_noise(one) else None
    return found


def _noise_json(c: Calibration) -> dict[str, Any]:
    noise = c.noise
    tracker = next((one.name for one in c.by_instrument if one.kind == "tracker"), None)
    sigmas = [(name, float(s), unit) for (name, unit), s in zip(c.sigmas, noise.sigma, strict=True)]
    of_tracker = {unit: sigma for name, sigma, unit in sigmas if name == tracker}
    return {
        "position_sigma": of_tracker.get("m"),
        "orientation_sigma": of_tracker.get("rad"),
        "sigma": [
            {"instrument": name or "tracker", "value": sigma, "estimated": bool(estimated)}
            for (name, sigma, _), estimated in zip(sigmas, noise.estimated, strict=True)
        ],
        "repeatability": noise.repeatability,
        "range_ratio": noise.range_ratio if noise.sight is not None else None,
        "source": noise.source,
        "tail_freedom": c.freedom if np.isfinite(c.freedom) else None,
        "enlarged": c.sigma_scale,
    }
