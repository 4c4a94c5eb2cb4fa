"""The result of a calibration by any instruments: as for a tracker, with the unknowns and the errors of each instrument."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.between_poses import places_of, poses_of, unexplained
from gtpin.calibration.left_out import left_out
from gtpin.calibration.observability import observability
from gtpin.calibration.readings_problem import ReadingsProblem
from gtpin.calibration.result import Calibration, fit_json
from gtpin.calibration.settled import Settled
from gtpin.calibration.unseen_remedies import Remedy
from gtpin.data import Dataset, Instrument
from gtpin.estimate import Estimate
from gtpin.instruments.instrument import Unknown
from gtpin.instruments.readings import Readings
from gtpin.model.fit_conditions import Unexplained
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.output.shown import present
from gtpin.typing import Floats


@dataclass(frozen=True)
class InstrumentFit:
    """How well a calibration fits the readings of one instrument.

    Parameters
    ----------
    name, kind
        As in dataset.toml.
    readings
        Number of used rows of its table.
    before, after
        Root mean square error of its readings, in ``unit``. ``before``: of the nominal robot with the best values of the
        instrument's unknowns. ``after``: of the calibrated robot. For positions: of the length of the error vector.
    floor
        The root mean square error that noise alone would leave, in ``unit``.
    unit
        ``m`` or ``rad``.
    left_out
        The root mean square error of its readings, in ``unit``, each pose predicted by a fit without it. What the other poses
        do not determine counts as 0.
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

    Parameters
    ----------
    unknowns
        The instruments' unknowns.
    u, u_covariance
        (k,) identified values of the unknowns less their declared values, m or rad, and the (k, k) covariance.
    by_instrument
        Errors of each instrument.
    sigmas
        Name of each instrument, and the number of its sigmas in ``noise``.
    remedies
        For each unobservable direction, the measurement that would show it; None where none is known.

    ``residual`` and ``residual_before`` have one row for each used row of the fitted data, ``noise`` one sigma for each group
    of numbers.
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


def readings_calibration(
    settled: Settled[ReadingsProblem],
    before: Floats,
    readings: Readings,
    rejected: tuple[str, ...],
    rejected_rows: tuple[int, ...],
    dataset: Dataset,
) -> ReadingsCalibration:
    """Make the result from the converged iterations.

    Parameters
    ----------
    settled
        The converged iterations.
    before
        (N, c) residuals of the nominal geometry, of all fitted rows.
    readings
        The rows that were fitted, gross errors included.
    rejected, rejected_rows
        Ids of the poses with rejected rows, and the line numbers of these rows.
    dataset
        The input data.
    """
    final = settled.final
    problem, point = final.problem, final.point
    p, geometry = problem.n_geometry, point.model.geometry
    whole = final.covariance
    covariance = whole[:p, :p] * np.outer(geometry.tolerance, geometry.tolerance)
    u, unit = problem.unknowns(point.x), problem.unit
    # Unknowns' priors are information on them, so that they count as rows of the derivative.
    priors = np.diag(problem.prior)[p:]
    factor = np.vstack([final.factor, priors[priors.any(axis=1)]])
    left = problem.readings.at(u).minus(point.poses)
    poses = poses_of(problem.readings.q)
    out, some = left_out(final, poses)
    out = np.asarray(np.linalg.solve(problem.whitening, out[..., None])[..., 0])
    return ReadingsCalibration(
        model=replace(
            point.model,
            covariance=covariance,
            instruments=readings.at(u).fitted,
            unexplained=_unexplained(settled, left),
        ),
        covariance=covariance,
        observability=observability(factor, p, final.residual.size),
        noise=settled.noise,
        enlarged=settled.excess,
        freedom=min([tails.freedom for tails in settled.tails], default=np.inf),
        poses=_count(readings, settled.used),
        rejected=rejected,
        rejected_rows=rejected_rows,
        chi2=settled.chi2,
        dof=settled.dof,
        iterations=settled.steps,
        residual=left,
        residual_before=before[settled.used],
        instrument=Instrument(),
        dataset=dataset,
        unknowns=readings.unknowns,
        sigmas=tuple((one.name, len(one.declared)) for one in readings.instruments),
        u=u,
        u_covariance=whole[p:, p:] * np.outer(unit, unit),
        by_instrument=_by_instrument(
            problem.readings, (before[settled.used], left, out), some, settled.noise.take(settled.used)
        ),
    )


def _unexplained(settled: Settled[ReadingsProblem], left: Floats) -> Unexplained:
    """What the fit leaves unexplained between poses; ``left`` (N, c): its residuals, m and rad."""
    readings, each = settled.fit.problem.readings, settled.noise.take(settled.used).each
    group = readings.group
    counted = readings.counted.ravel() > 0.0
    return unexplained(
        left.ravel()[counted],
        (left / each).ravel()[counted],
        (each**2).ravel()[counted],
        places_of(readings).ravel()[counted],
        readings.group_turns[group].ravel()[counted],
        settled.fit.taken,
        known=settled.noise.source != "residuals",
        dof=settled.noise.dof,
    )


def _count(readings: Readings, used: npt.NDArray[np.bool_]) -> int:
    """Number of rows of the tables that are used; the components of one row count once."""
    return len(np.unique(np.column_stack([readings.rows.of[used], readings.rows.line[used]]), axis=0))


def _by_instrument(
    readings: Readings, errors: tuple[Floats, Floats, Floats], some: npt.NDArray[np.bool_], noise: ReadingNoise
) -> tuple[InstrumentFit, ...]:
    """Errors of each instrument: before, after, and left out; the last are of the rows ``some`` (N,)."""
    found = []
    before, after, out = errors
    each, part = noise.each, readings.take(some)
    for i, one in enumerate(readings.instruments):
        mine = readings.rows.of == i
        count = max(len(np.unique(readings.rows.line[mine])), 1)
        unit = next(c.unit for c in one.components if c.shown)
        b, a, n = (readings.rms(i, values) for values in (before, after, each))
        found.append(InstrumentFit(one.name, one.kind, count, b, a, n, unit, part.rms(i, out[some])))
    return tuple(found)
