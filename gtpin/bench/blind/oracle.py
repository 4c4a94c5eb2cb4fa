"""Oracle baseline: a fit to which the true causes are given, each with the scale and nonlinear parameter that fit its true
displacement best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gtpin.bench.blind.difficulty import Best
from gtpin.bench.blind.seen import noise_of_rows
from gtpin.calibration.noise_estimator import noise_at
from gtpin.calibration.problem import measured_poses
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.inference.joint_fit import fit_together
from gtpin.diagnosis.linear.observed import Observed
from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import Situation
from gtpin.instruments.readings import Readings, single
from gtpin.model.model import Model
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats


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
    noise = noise_at(baseline.noise, Readings.of(kept, model.robot))
    whitening = noise.whitening(at.command_jacobian, measured.components)

    def whitened(columns: Floats) -> Floats:
        return np.asarray(whitening @ columns[:, : measured.components]).reshape(-1, columns.shape[2])

    bases = [cause.effect.basis_of(at, cause.site, cause.values) for cause in causes]
    sizes = [basis.sigma * cause.scale for basis, cause in zip(bases, causes, strict=True)]
    B = whitened(kinematics.geometry_jacobian(kept.q, poses) * geometry.tolerance)
    J = np.hstack([B, *(whitened(basis.displacement(at) * size) for basis, size in zip(bases, sizes, strict=True))])
    left = whitened(measured.minus(poses)[:, :, None])[:, 0]
    now = np.zeros(J.shape[1])
    now[: B.shape[1]] = geometry.deviation / geometry.tolerance
    covariance = np.linalg.inv(J.T @ J + np.eye(J.shape[1]))
    step = covariance @ (J.T @ left - now)
    moved = geometry.with_values(geometry.values + geometry.tolerance * step[: B.shape[1]])
    active, place = [], B.shape[1]
    for cause, size in zip(causes, sizes, strict=True):
        own = slice(place, place := place + len(size))
        uncertain = covariance[own, own] * np.outer(size, size)
        active.append(
            ActiveEffect(
                cause.effect, cause.site, cause.nonlinear, step[own] * size, uncertain, at.references, cause.further
            )
        )
    return Model(moved, model.frame, tuple(active))


def fit_known_causes_to_readings(
    dataset: Dataset, noise: Mapping[str, Floats], baseline: Calibration, causes: Sequence[Best]
) -> Model:
    """Fit geometry, the instruments' unknowns and the given causes together, from a calibration, until the fit converges.

    One step is not enough here: from readings of few places the geometry moves far along directions that they hardly show.
    Prior sigmas are those of :func:`fit_known_causes`, and the instruments' own.

    ``noise``: by the instruments' names, (M, c) true sigma of the numbers in the rows of their tables, m or rad, so that no
    estimate of the noise makes this fit worse. A known distance of sockets has the noise of the calibration. ``Raises
    ConvergenceError if the fit does not converge.``: .
    """
    split = single(dataset, baseline.model.robot)
    observed = Observed.of(split, baseline)
    taken = observed.noise
    assert isinstance(taken, ReadingNoise)
    sigma = taken.each.copy()
    for row, true in zip(sigma, noise_of_rows(dataset, split, noise)[1], strict=True):
        if len(true):
            row[:] = true
    observed = replace(observed, noise=replace(taken, row_sigma=sigma)).take(baseline.used(split))
    given = [Hypothesis(cause.effect, cause.site, cause.nonlinear, further=cause.further) for cause in causes]
    references = observed.situation(baseline.model).references
    return fit_together(observed, baseline.model, given, [cause.scale for cause in causes], references)
