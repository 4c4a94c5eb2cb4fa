"""The linear problem of a check: new poses less what an earlier model predicts, whitened, and how uncertain that is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gtpin.calibration.problem import Measured, rough_frame
from gtpin.diagnosis.against.earlier import Earlier
from gtpin.diagnosis.linear.design import Design
from gtpin.effects.situation import Column, Situation
from gtpin.errors import ConvergenceError
from gtpin.instruments.readings import VAGUE, Readings
from gtpin.kinematics.poses import Poses
from gtpin.model.fit_conditions import EXPLAINED, ModelDiscrepancy
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats

STEPS = 20
"""Most Gauss-Newton steps of the instruments' unknowns. Measured: a station that was declared half a metre off takes four."""
SETTLED = 1e-3
"""Change of the unknowns, in standard deviations of their priors, that ends the steps; less than the check's other errors."""


@dataclass(frozen=True)
class Conditions:
    """The conditions under which a check is measured.

    ``noise``: noise of the check's poses or readings. ``free_frame``: whether the pose of the instrument is unknown.
    ``temperature``: reference temperature, degC, at which the geometry holds. ``unexplained``: what the earlier model left
    unexplained of its own data: a part of the uncertainty of every prediction. ``noise_known``: whether ``noise`` was declared,
    or repeated visits showed it. Otherwise it is as small as noise can be, and what was left of the earlier fit is all in
    ``unexplained``.
    """

    noise: ReadingNoise
    free_frame: bool
    temperature: float = 20.0
    unexplained: ModelDiscrepancy = EXPLAINED
    noise_known: bool = True

    def expected(self, measured: Readings) -> ReadingNoise:
        """Noise and unexplained errors together, as if these were independent from pose to pose."""
        left, noise = self.unexplained, self.noise
        if left.none:
            return noise
        more = np.where(measured.group_turns, left.orientation, left.position)
        return replace(noise, sigma=np.hypot(noise.sigma, more), row_sigma=np.hypot(noise.row_sigma, more[noise.group]))


def expectation(
    earlier: Earlier,
    measured: Readings,
    covariates: Mapping[str, Column],
    how: Conditions,
    since: Mapping[str, Column],
) -> Design:
    """The linear problem about an earlier model: y ~ N(0, I + B B') where nothing has changed.

    y is the whitened difference of the measured poses and those that the model predicts. B is the whitened derivative by the
    model's unknowns, scaled by the root of their posterior covariance, and by the pose of the instrument where that is unknown,
    or by the unknowns of the instruments, scaled by the sigmas of their priors.

    ``measured``: the poses or readings of the check. ``covariates``: the covariates as they
    were recorded. ``how``: noise, frame and temperature. ``since``: the covariates on which changes depend: see
    :meth:`Earlier.since`.

    Raises `ModelError` if a covariate is missing that an effect of the model needs.
    """
    kinematics, q = earlier.model.kinematics, measured.q
    plain = kinematics.forward(q)
    poses = earlier.predicted(q, covariates, plain)
    model, at = earlier.model, Situation(kinematics, q, plain, since, temperature=how.temperature)
    c, noise = measured.components, how.expected(measured)
    if how.free_frame:
        model = replace(model, frame=rough_frame(poses, Measured(q, *measured.poses)))
    else:
        measured = with_unknowns(measured, noise, at.command_jacobian, poses)
    W = noise.whitening(measured.seen(at.command_jacobian, model, poses), c)
    by_model = measured.seen(earlier.jacobian(q, covariates, plain) @ earlier.root, model, poses)
    unknowns, free = measured.unknown_columns(model, poses, how.free_frame, None)
    B = np.asarray((W @ np.concatenate([by_model, unknowns], axis=2)).reshape(len(q) * c, -1))
    known = len(measured.deviation)
    y = np.einsum("nij,nj->ni", W, measured.left(model, poses)).ravel()
    y = y + B[:, B.shape[1] - free - known : B.shape[1] - free] @ measured.deviation
    return Design(at, W, model, y, B, B.shape[1] - free, measured.taken(how.free_frame), measured)


def with_unknowns(readings: Readings, noise: ReadingNoise, J: Floats, poses: Poses) -> Readings:
    """The readings with the values of the instruments' unknowns that fit them best where the robot is at ``poses``.

    The linear problem of a check is about these values, because the unknown place of an instrument may be off by decimetres.

    ``J``: (N, 6 + k, n) derivative of the poses, base frame, by the commands. ``poses``: (N) poses that the earlier model
    predicts, base frame.

    Raises `ConvergenceError` if they have not converged.
    """
    found = readings.at(readings.start(poses))
    if not len(found.sigma):
        return found
    sigma = np.where(np.isfinite(found.sigma), found.sigma, VAGUE)
    prior = np.isfinite(found.sigma).astype(float)
    for _ in range(STEPS):
        W = noise.whitening(np.asarray(found.by_motion(poses) @ J), found.components)
        columns = (W @ found.by_unknown(poses)).reshape(-1, len(sigma)) * sigma
        left = np.einsum("nij,nj->ni", W, found.minus(poses)).ravel()
        right = columns.T @ left - prior * found.deviation
        step = np.linalg.lstsq(columns.T @ columns + np.diag(prior), right, rcond=None)[0]
        found = found.at(found.u + sigma * step)
        if np.abs(step).max() < SETTLED:
            return found
    raise ConvergenceError(
        "the unknowns of the instruments have not converged",
        hint="check their stations, planes, sockets and targets in dataset.toml",
    )


def share_unexplained(design: Design, how: Conditions) -> float:
    """Share of unexplained errors in the mean variance of the whitened residuals; the rest is noise."""
    if how.unexplained.none:
        return 0.0
    measured, at = design.measured, design.situation
    noise = how.noise.covariance(measured.seen(at.command_jacobian, design.model, at.poses), design.components)
    W = design.whitening
    return float(np.clip(1.0 - np.einsum("nij,njk,nik->ni", W, noise, W).mean(), 0.0, 1.0))
