"""Make the result of a calibration of poses from the converged iterations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.between_poses import poses_of, unexplained_poses
from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.left_out import left_out
from gtpin.calibration.observability import observability
from gtpin.calibration.problem import Problem, in_frame
from gtpin.calibration.result import Calibration, lengths
from gtpin.calibration.settled import Settled
from gtpin.data import Dataset, Instrument
from gtpin.kinematics.poses import Poses
from gtpin.model.fit_conditions import FitConditions
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats


def calibration_of(
    settled: Settled[Problem],
    before: Poses,
    rejected: tuple[str, ...],
    rejected_rows: tuple[int, ...],
    instrument: Instrument,
    dataset: Dataset,
) -> Calibration:
    """Make the result from the converged iterations.

    Parameters
    ----------
    settled
        The converged iterations.
    before
        Poses of the nominal geometry in the instrument's frame, one for each used row.
    rejected, rejected_rows
        Ids of the poses with rejected rows, and the lines of these rows.
    instrument
        Description of the instrument that was used.
    dataset
        The data.
    """
    judged, final = settled.fit, settled.final
    problem, geometry = final.problem, final.point.model.geometry
    x_covariance, noise = final.covariance, settled.noise.as_poses()
    p, tolerance = problem.n_geometry, geometry.tolerance
    covariance = x_covariance[:p, :p] * np.outer(tolerance, tolerance)
    residual = problem.measured.minus(final.point.model.seen(final.point.poses))
    poses, known = poses_of(problem.measured.q), settled.noise.source != "residuals"
    variance = _variances(final, settled.noise.take(settled.used))
    unexplained = unexplained_poses(judged, residual, variance, poses, known=known, dof=settled.noise.dof)
    out, some = left_out(final, poses)
    out = np.asarray(np.linalg.solve(problem.whitening[some], out[some][..., None])[..., 0], dtype=np.float64)
    return Calibration(
        model=replace(
            final.point.model,
            covariance=covariance,
            solver="arrays",
            fit=FitConditions.of(noise, settled.chi2, settled.dof, dataset.covariates, unexplained),
            unexplained=unexplained,
        ),
        covariance=covariance,
        observability=observability(final.factor, p, final.residual.size),
        noise=noise,
        enlarged=settled.excess,
        freedom=min(tails.freedom for tails in settled.tails),
        poses=len(final.residual),
        rejected=rejected,
        rejected_rows=rejected_rows,
        chi2=settled.chi2,
        dof=settled.dof,
        iterations=settled.steps,
        residual=residual,
        residual_before=problem.measured.minus(before),
        instrument=instrument,
        dataset=dataset,
        left_out=lengths(out),
        floor=lengths(np.sqrt(variance)) if known else None,
    )


def _variances(fit: Fit[Problem], noise: ReadingNoise) -> Floats:
    """(N, c) variance of the noise of each component of the poses of a fit, m^2 and rad^2."""
    model, measured, found = fit.point.model, fit.problem.measured, []
    for rows in fit.problem.chunks():
        J = in_frame(model.kinematics.command_jacobian(measured.q[rows], fit.point.poses[rows]), model.frame)
        found.append(np.diagonal(noise.take(rows).covariance(J, measured.components), axis1=1, axis2=2))
    return np.concatenate(found)
