"""The result of a calibration by any instruments: as for a tracker, with the unknowns and the errors of each instrument."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.between_poses import poses_of, unexplained_by
from gtpin.calibration.fit_state import FitState
from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.left_out import left_out
from gtpin.calibration.observability import observability
from gtpin.calibration.problem import Problem
from gtpin.calibration.result import Calibration, fit_json, lengths
from gtpin.calibration.unseen_remedies import Remedy
from gtpin.data import Dataset, Instrument
from gtpin.estimate import Estimate
from gtpin.instruments.instrument import Unknown
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses
from gtpin.model.fit_conditions import FitConditions
from gtpin.noise.noise import Noise
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.output.shown import present
from gtpin.typing import Floats, Mask


@dataclass(frozen=True)
class InstrumentFit:
    """How well a calibration fits the readings of one instrument.

    - ``name``, ``kind``: as in dataset.toml.
    - ``readings``: number of used rows of its table.
    - ``before``, ``after``: root mean square error of its readings, in ``unit``. ``before``: of the nominal robot with the
      best values of the instrument's unknowns. ``after``: of the calibrated robot. For positions: of the length of the
      error vector.
    - ``floor``: the root mean square error that noise alone would leave, in ``unit``.
    - ``unit``: ``m`` or ``rad``.
    - ``left_out``: the root mean square error of its readings, in ``unit``, each pose predicted by a fit without it. What
      the other poses do not determine counts as 0.
    """

    name: str
    kind: str
    readings: int
    before: float
    after: float
    floor: float
    unit: str
    left_out: float

    def to_json(self) -> dict[str, Any]:
        """As in ``calibration.json``."""
        return {
            "rms_before": self.before,
            "rms_after": self.after,
            "rms_left_out": self.left_out,
            "noise_floor": self.floor,
            "unit": self.unit,
        }


@dataclass(frozen=True, repr=False)
class ReadingsCalibration(Calibration):
    """A calibration by any instruments.

    - ``unknowns``: the instruments' unknowns.
    - ``u``, ``u_covariance``: (k,) identified values of the unknowns less their declared values, m or rad, and the (k, k)
      covariance.
    - ``by_instrument``: errors of each instrument.
    - ``sigmas``: name of each instrument, and the number of its sigmas in ``noise``.
    - ``remedies``: for each unobservable direction, the measurement that would show it; None where none is known.
    - ````residual`` and ``residual_before`` have one row for each used row of the fitted data``, ````noise`` one sigma for
      each group``: .
    - ``of numbers.``: .
    """

    noise: ReadingNoise  # type: ignore[assignment]
    unknowns: tuple[Unknown, ...] = ()
    u: Floats = field(default_factory=lambda: np.zeros(0))
    u_covariance: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    by_instrument: tuple[InstrumentFit, ...] = ()
    sigmas: tuple[tuple[str, int], ...] = ()
    remedies: tuple[Remedy | None, ...] = ()

    @property
    def words(self) -> tuple[str, ...]:
        """A sentence for each unobservable direction."""
        words: tuple[str, ...] = present(self).unseen()
        return words

    def to_json(self) -> dict[str, Any]:
        """The content of ``calibration.json``: instruments' unknowns are listed after the geometry's parameters."""
        tracker = next((one for one in self.by_instrument if one.kind == "tracker"), None)
        errors = {
            "position_rms_before": tracker.before if tracker else None,
            "position_rms_after": tracker.after if tracker else None,
            "position_rms_left_out": tracker.left_out if tracker else None,
            "orientation_rms_before": None,
            "orientation_rms_after": None,
        }
        noise = {
            "sigma": [
                {"instrument": name, "value": float(sigma), "estimated": bool(estimated)}
                for name, sigma, estimated in zip(self._groups, self.noise.sigma, self.noise.estimated, strict=True)
            ],
            "repeatability": self.noise.repeatability,
            "source": self.noise.source,
        }
        content = fit_json(self, errors, noise)
        content["parameters"] += [self._parameter(i) for i in range(len(self.unknowns))]
        for direction, words in zip(content["unobservable"], self.words, strict=True):
            direction["words"] = words
        return content | {"by_instrument": {one.name: one.to_json() for one in self.by_instrument}}

    @property
    def _groups(self) -> tuple[str, ...]:
        """The instrument of each of the noise's sigmas."""
        return tuple(name for name, count in self.sigmas for _ in range(count))

    def _parameter(self, index: int) -> dict[str, Any]:
        one, prior = self.unknowns[index], self.unknowns[index].sigma
        estimate = self.unknown(one.name)
        return {
            "name": one.name,
            "value": estimate.value,
            "sigma": estimate.sigma,
            "unit": one.unit,
            "nominal": one.nominal,
            "tolerance": prior if np.isfinite(prior) else None,
            "learned": 1.0 - (estimate.sigma / prior) ** 2 if np.isfinite(prior) else 1.0,
        }

    def unknown(self, name: str) -> Estimate:
        """Value and sigma of one of the instruments' unknowns, by its name."""
        index = [one.name for one in self.unknowns].index(name)
        sigma = float(np.sqrt(self.u_covariance[index, index]))
        one = self.unknowns[index]
        return Estimate(one.nominal + float(self.u[index]), sigma, one.unit)


def calibration_of(
    settled: FitState,
    near: Poses,
    whole: Dataset,
    usable: Mask,
    dataset: Dataset,
    instrument: Instrument | None = None,
) -> Calibration:
    """Make the result from the converged iterations; a :class:`ReadingsCalibration` unless poses were measured.

    ``settled``: the converged iterations. ``near``: (M) poses of the nominal geometry, base frame, at the fitted rows,
    gross errors included. ``whole``, ``usable``: N rows, and (N,) True for the M rows that were fitted. ``dataset``: the
    input data. ``instrument``: description of the tracker that was used; None where readings were fitted.
    """
    final, noise = settled.final, settled.noise.take(settled.used)
    problem, point = final.problem, final.point
    p, geometry, measured = problem.n_geometry, point.model.geometry, problem.measured
    aside = np.ones(len(whole), dtype=bool)
    aside[np.flatnonzero(usable)[settled.used]] = False
    covariance = final.covariance[:p, :p] * np.outer(geometry.tolerance, geometry.tolerance)
    # Unknowns' priors are information on them, so that they count as rows of the derivative.
    priors = np.diag(problem.prior)[p:]
    factor = np.vstack([final.factor, priors[priors.any(axis=1)]])
    before = settled.fit.problem.measured.left(settled.fit.problem.start, near[settled.used])
    left = problem.left(point, point.poses)
    variance, known = _variances(final, noise), noise.source != "residuals"
    unexplained = unexplained_by(settled.fit, left, variance, known=known, dof=noise.dof)
    out, some = left_out(final, poses_of(measured.q))
    out = np.asarray(np.linalg.solve(problem.whitening[some], out[some][..., None])[..., 0], dtype=np.float64)
    found = Calibration(
        model=replace(point.model, covariance=covariance, solver="arrays", unexplained=unexplained),
        covariance=covariance,
        observability=observability(factor, p, final.residual.size),
        noise=settled.noise,  # type: ignore[arg-type]
        enlarged=settled.excess,
        freedom=min([tails.freedom for tails in settled.tails], default=np.inf),
        poses=_count(measured),
        rejected=tuple(dict.fromkeys(str(pose) for pose in whole.pose[aside])),
        rejected_rows=tuple(dict.fromkeys(int(line) for line in whole.row[aside])),
        chi2=settled.chi2,
        dof=settled.dof,
        iterations=settled.steps,
        residual=left,
        residual_before=before,
        instrument=instrument or Instrument(),
        dataset=dataset,
    )
    if measured.tracked:
        conditions = FitConditions.of(
            Noise.of(settled.noise), settled.chi2, settled.dof, dataset.covariates, unexplained
        )
        return replace(
            found,
            model=replace(found.model, fit=conditions),
            noise=Noise.of(settled.noise),
            left_out=lengths(out),
            floor=lengths(np.sqrt(variance)) if known else None,
        )
    readings, unit = problem.readings(point.x), problem.unit
    own = {field.name: getattr(found, field.name) for field in fields(Calibration)}
    return ReadingsCalibration(
        **own | {"model": replace(found.model, instruments=readings.fitted)},
        unknowns=readings.unknowns,
        sigmas=tuple((one.name, len(one.declared)) for one in readings.instruments),
        u=readings.u,
        u_covariance=final.covariance[p:, p:] * np.outer(unit, unit),
        by_instrument=_by_instrument(readings, (before, left, out), some, noise),
    )


def _variances(fit: Fit[Problem], noise: ReadingNoise) -> Floats:
    """(N, c) variance of the noise of each number of a fit's rows, m^2 and rad^2; ``noise``: that of these rows."""
    if noise.along_drives == 0.0 and noise.sight is None:
        return noise.each**2
    model, measured, found = fit.point.model, fit.problem.readings(fit.point.x), []
    for rows in fit.problem.chunks():
        poses, some = fit.point.poses[rows], measured.take(rows)
        J = some.seen(model.kinematics.command_jacobian(some.q, poses), model, poses)
        found.append(np.diagonal(noise.take(rows).covariance(J, measured.components), axis1=1, axis2=2))
    return np.concatenate(found)


def _count(readings: Readings) -> int:
    """Number of rows of the tables; the components of one row count once."""
    return len(readings.rows) if (readings.rows.component < 0).all() else int(readings.rows.row.max()) + 1


def _by_instrument(
    readings: Readings, errors: tuple[Floats, Floats, Floats], some: npt.NDArray[np.bool_], noise: ReadingNoise
) -> tuple[InstrumentFit, ...]:
    """Errors (N, c) of each instrument: before, after, and left out; the last of the rows ``some`` (N,) alone."""
    found = []
    before, after, out = errors
    each, part = noise.each, readings.take(some)
    for i, one in enumerate(readings.instruments):
        mine = readings.rows.of == i
        count = max(len(np.unique(readings.rows.line[mine])), 1)
        unit = next(c.unit for c in one.components if c.shown)
        b, a, n = (readings.rms(i, values) for values in (before, after, each))
        found.append(InstrumentFit(one.name, one.kind, count, b, a, n, unit, part.rms(i, out)))
    return tuple(found)
