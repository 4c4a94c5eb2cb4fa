"""Oracle baseline: a fit to which the true causes are given, each with the scale and nonlinear parameter that fit its true
displacement best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gtpin.blind.difficulty import Best
from gtpin.blind.seen import noise_of_rows
from gtpin.calibration.problem import measured_poses
from gtpin.calibration.readings_result import ReadingsCalibration
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.linear.observed import Observed
from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import Situation
from gtpin.instruments.readings import VAGUE, Readings, single
from gtpin.model.model import Model
from gtpin.noise.reading_noise import ReadingNoise

Floats = npt.NDArray[np.float64]


def fit_known_causes(dataset: Dataset, baseline: Calibration, causes: Sequence[Best]) -> Model:
    """Fit geometry and the given causes together, in one Gauss-Newton step from a calibration in the robot's frame.

    Prior sigmas are the tolerances for the geometry, and for a cause's coefficients their typical sizes times its scale.
    """
    kept = dataset.take(baseline.used(dataset))
    model = baseline.model
    kinematics, geometry = model.kinematics, model.geometry
    poses = kinematics.forward(kept.q)
    at = Situation(kinematics, kept.q, poses, kept.covariates, None, kept.conditions.reference_temperature)
    measured = measured_poses(kept)
    whitening = baseline.noise.whitening(at.command_jacobian, measured.components)

    def whitened(columns: Floats) -> Floats:
        return np.asarray(whitening @ columns[:, : measured.components]).reshape(-1, columns.shape[2])

    bases = [cause.effect.basis_of(at, cause.site, cause.values) for cause in causes]
    sizes = [basis.sigma * cause.scale for basis, cause in zip(bases, causes, strict=True)]
    B = whitened(kinematics.geometry_jacobian(kept.q, poses) * geometry.tolerance)
    J = np.hstack([B, *(whitened(basis.displacement(at) * size) for basis, size in zip(bases, sizes, strict=True))])
    left = whitened(measured.minus(poses)[:, :, None])[:, 0]
    now = np.zeros(J.shape[1])
    now[: B.shape[1]] = geometry.deviation / geometry.tolerance
    covariance = np.asarray(np.linalg.inv(J.T @ J + np.eye(J.shape[1])), dtype=float)
    step = covariance @ (J.T @ left - now)
    moved = geometry.with_values(geometry.values + geometry.tolerance * step[: B.shape[1]])
    return Model(moved, model.frame, _active(causes, sizes, step, covariance, at))


def fit_known_causes_to_readings(
    dataset: Dataset, noise: Mapping[str, Floats], baseline: ReadingsCalibration, causes: Sequence[Best]
) -> Model:
    """Fit geometry, the instruments' unknowns and the given causes together, in one Gauss-Newton step from a calibration.

    The noise is the true one, so that no estimate of it makes this fit worse. Prior sigmas are those of
    :func:`fit_known_causes`, and the instruments' own.

    Parameters
    ----------
    noise
        By the instruments' names, (M, c) sigma of the numbers in the rows of their tables, m or rad. A known distance of
        sockets has the noise of the calibration.
    """
    split = single(dataset, baseline.model.robot)
    observed = Observed.of(split, baseline)
    readings, taken = observed.measured, observed.noise
    assert isinstance(readings, Readings)
    assert isinstance(taken, ReadingNoise)
    sigma = taken.each.copy()
    for row, true in zip(sigma, noise_of_rows(dataset, split, noise)[1], strict=True):
        if len(true):
            row[:] = true
    observed = replace(observed, noise=replace(taken, row_sigma=sigma)).take(baseline.used(split))
    design = observed.design(baseline.model)
    bases = [cause.effect.basis_of(design.situation, cause.site, cause.values) for cause in causes]
    sizes = [basis.sigma * cause.scale for basis, cause in zip(bases, causes, strict=True)]
    J = np.hstack(
        [design.B, *(design.columns(basis) * cause.scale for basis, cause in zip(bases, causes, strict=True))]
    )
    covariance = np.asarray(np.linalg.inv(J.T @ J + np.eye(J.shape[1])), dtype=float)
    found = covariance @ (J.T @ design.y)
    geometry, p = baseline.model.geometry, len(baseline.model.geometry.parameters)
    nominal = geometry.values - geometry.deviation
    prior = readings.sigma
    own = found[p : p + len(prior)]
    known = np.isfinite(prior)
    u = np.where(known, 0.0, readings.u) + np.where(known, prior, VAGUE) * own
    return replace(
        baseline.model,
        geometry=geometry.with_values(nominal + geometry.tolerance * found[:p]),
        effects=_active(causes, sizes, found, covariance, design.situation),
        instruments=readings.at(u).fitted,
    )


def _active(
    causes: Sequence[Best], sizes: Sequence[Floats], found: Floats, covariance: Floats, at: Situation
) -> tuple[ActiveEffect, ...]:
    """The causes with their coefficients, the last of the fitted unknowns ``found``, in units of their priors' sigmas."""
    active, place = [], len(found) - sum(map(len, sizes))
    for cause, size in zip(causes, sizes, strict=True):
        own = slice(place, place := place + len(size))
        uncertain = covariance[own, own] * np.outer(size, size)
        active.append(
            ActiveEffect(
                cause.effect, cause.site, cause.nonlinear, found[own] * size, uncertain, at.references, cause.further
            )
        )
    return tuple(active)
