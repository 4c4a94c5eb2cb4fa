"""Baselines of a check: a fit to which the true causes are given, and a Gaussian process that names no cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from gtpin.bench.blind.difficulty import Best, noise_of_rows
from gtpin.calibration.noise_estimator import noise_at
from gtpin.calibration.problem import measured_poses
from gtpin.calibration.result import Calibration
from gtpin.data import Commands, Dataset
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.joint_fit import fit_together
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import OperatingPoints
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
    at = OperatingPoints(kinematics, kept.q, poses, kept.covariates, None, kept.conditions.reference_temperature)
    measured = measured_poses(kept)
    noise = noise_at(baseline.noise, Readings.of(kept, model.robot))
    whitening = noise.whitening(at.command_jacobian, measured.components)

    def whitened(columns: Floats) -> Floats:
        return np.asarray(whitening @ columns[:, : measured.components]).reshape(-1, columns.shape[2])

    bases = [cause.effect.basis_of(at, cause.site, cause.values) for cause in causes]
    sizes = [basis.sigma * cause.scale for basis, cause in zip(bases, causes, strict=True)]
    B = whitened(kinematics.geometry_jacobian(kept.q, poses) * geometry.tolerance)
    J = np.hstack([B, *(whitened(basis.displacement(at) * size) for basis, size in zip(bases, sizes, strict=True))])
    residual = whitened(measured.residual_at(poses)[:, :, None])[:, 0]
    now = np.zeros(J.shape[1])
    now[: B.shape[1]] = geometry.deviation / geometry.tolerance
    covariance = np.linalg.inv(J.T @ J + np.eye(J.shape[1]))
    step = covariance @ (J.T @ residual - now)
    moved = geometry.with_values(geometry.values + geometry.tolerance * step[: B.shape[1]])
    active, place = [], B.shape[1]
    for cause, size in zip(causes, sizes, strict=True):
        own = slice(place, place := place + len(size))
        uncertain = covariance[own, own] * np.outer(size, size)
        found = (cause.shape_parameter, step[own] * size, uncertain, at.references, cause.further)
        active.append(ActiveEffect(cause.effect, cause.site, *found))
    return Model(moved, model.frame, tuple(active))


def fit_known_causes_to_readings(
    dataset: Dataset, noise: Mapping[str, Floats], baseline: Calibration, causes: Sequence[Best]
) -> Model:
    """Fit geometry, the instruments' unknowns and the given causes together, from a calibration, until the fit converges.

    One step is not enough here: from readings of few places the geometry moves far along directions that they hardly show.
    Prior sigmas are those of :func:`fit_known_causes`, and the instruments' own.

    ``noise``: by the instruments' names, (M, c) true sigma of the numbers in the rows of their tables, m or rad, so that no
    estimate of the noise makes this fit worse. A known distance of sockets has the noise of the calibration.

    Raises ConvergenceError if the fit does not converge.
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
    given = [Hypothesis(cause.effect, cause.site, cause.shape_parameter, further=cause.further) for cause in causes]
    references = observed.operating_points(baseline.model).references
    return fit_together(observed, baseline.model, given, [cause.scale for cause in causes], references)


START = np.log([2.0, 0.7, 1.0, 0.7])
"""Start of the search, logarithms: amplitude and length scale over the commands, amplitude over the covariates, and noise,
in units of the residuals' standard deviation and the commands' spread."""
TRIALS = 60
ROWS = 400
"""Largest number of rows that are used."""


def gaussian_process_positions(dataset: Dataset, baseline: Model, commands: Commands) -> Floats:
    """(H, 3) positions at commands, m: those of the baseline plus a Gaussian process fitted to its residuals at the dataset's
    rows.

    Squared-exponential kernels over the commands together and over each covariate alone (its length scale
    is the covariate's spread); the other hyperparameters by maximum a posteriori (Rasmussen and Williams 2006, ch. 5).
    """
    rows = np.linspace(0, len(dataset) - 1, min(len(dataset), ROWS)).astype(int)
    residual = dataset.position[rows] - baseline.predict(dataset.q[rows]).T
    size = max(float(residual.std()), 1e-12)
    y = (residual - residual.mean(axis=0)) / size
    own, wanted = _covariates(dataset.commands, commands)[rows], _covariates(commands, dataset.commands)
    near = _near(dataset.q[rows], own, dataset.q[rows], own)

    def factor(log: Floats) -> tuple[Floats, bool]:
        return cho_factor(_kernel(near, log) + (np.exp(2.0 * log[3]) + 1e-8) * np.eye(len(y)), lower=True)

    def cost(log: Floats) -> float:
        try:
            lower = factor(log)
        except np.linalg.LinAlgError:
            return 1e12
        fit = 0.5 * float((y * cho_solve(lower, y)).sum()) + 3.0 * float(np.log(np.diag(lower[0])).sum())
        return fit + float(((log - START) ** 2).sum()) / 8.0

    best = minimize(cost, START, method="Nelder-Mead", options={"maxfev": TRIALS}).x
    across = _kernel(_near(dataset.q[rows], own, commands.q, wanted), best)
    correction = across.T @ cho_solve(factor(best), y) * size + residual.mean(axis=0)
    return np.asarray(baseline.predict(commands.q).T + correction)


def _covariates(own: Commands, other: Commands) -> Floats:
    """(N, c) numeric covariates that both have."""
    both = [n for n in own.covariates if n in other.covariates and own.covariates[n].dtype == np.float64]
    return np.column_stack([np.zeros((len(own), 0)), *(own.covariates[n] for n in both)])


def _near(q: Floats, covariates: Floats, other_q: Floats, other: Floats) -> tuple[Floats, Floats]:
    """(N, H) squared distances over the commands, and the mean kernel of the covariates, in units of their spreads."""
    spread, spreads = max(float(q.std(axis=0).mean()), 1e-12), covariates.std(axis=0)
    over_q = (((q[:, None] - other_q) / spread) ** 2).sum(axis=2)
    vary = spreads > 1e-9
    if not vary.any():
        return over_q, np.zeros(over_q.shape)
    squares = ((covariates[:, None, vary] - other[:, vary]) / spreads[vary]) ** 2
    return over_q, np.exp(-0.5 * squares).mean(axis=2)


def _kernel(near: tuple[Floats, Floats], log: Floats) -> Floats:
    over_q, together = near
    return np.asarray(np.exp(2.0 * log[0] - 0.5 * over_q * np.exp(-2.0 * log[1])) + np.exp(2.0 * log[2]) * together)
