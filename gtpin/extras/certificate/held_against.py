"""A model compared with measured poses: errors, scatter of visits, and its posterior propagated to poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.calibration.left_out import of_poses
from gtpin.calibration.problem import Measured, measured_poses, rough_frame
from gtpin.data import Dataset
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.kinematics.rotations import exp, frame_motions
from gtpin.model.model import Frame, Model, in_frame, joined, root_of
from gtpin.noise.estimate import LEAST_CONTRASTS, contrasts, likeliest
from gtpin.noise.noise import Noise
from gtpin.typing import Floats

DETERMINED, FEWEST = 0.5, 10
"""The test whether the model was fitted to the poses uses only directions of the unknowns that these poses determine at least
half as well as the best direction, and needs at least ten such directions."""
FREE = 1.0
"""Prior standard deviation of a free frame's shift, m, and rotation, rad: so wide that it has no influence."""
SMALL = 0.2
"""Mean square of the score, in its standard deviations, below which the poses count as fitted. Its expected value is 1 for new
poses; for ten directions it is then below 0.2 in 4 of 1,000 cases (chi-square)."""


def at_commands(model: Model, q: Floats, covariates: Mapping[str, Column]) -> OperatingPoints:
    """N commands (N, n), m or rad, with covariates, and the poses there of the model's geometry without effects."""
    return OperatingPoints(model.kinematics, q, model.kinematics.forward(q), covariates)


def by_unknowns(model: Model, at: OperatingPoints) -> Floats:
    """(N, 6, p + m) derivative of the poses, instrument's frame, m and rad, by the p geometric parameters and the effects' m
    coefficients."""
    columns = [model.kinematics.geometry_jacobian(at.q, at.poses)[:, :6]]
    for active in model.effects:
        own = replace(at, fixed=active.references)
        columns.append(active.basis(own).displacement(own)[:, :6])
    return in_frame(np.concatenate(columns, axis=2), model.frame)


def by_commands(model: Model, at: OperatingPoints) -> Floats:
    """(N, 6, n) derivative of the poses by the commands, instrument's frame, m and rad."""
    return in_frame(model.kinematics.command_jacobian(at.q, at.poses)[:, :6], model.frame)


@dataclass(frozen=True)
class FreeFrame:
    """The posterior of an unknown instrument frame, from the fitted poses.

    Given the other unknowns x (geometry and effects), the deviation f of the frame, a shift, m, and a rotation, rad, is
    N(-K (x - mean), C). K and C are those of weighted least squares without a prior. With the covariance of x this is the joint
    posterior of f and x.

    ``pivot``: (3,) point about which the frame rotates, m, instrument's frame. ``gain``, ``covariance``: K (6, p + m) and C
    (6, 6).
    """

    pivot: Floats
    gain: Floats
    covariance: Floats

    @staticmethod
    def of(model: Model, fitted: OperatingPoints, whitening: Floats) -> FreeFrame:
        """The frame's posterior from the poses of a fit; whitening (N, c, c) of their c = 3 or 6 components."""
        c = whitening.shape[1]
        seen = model.in_instrument_frame(fitted.poses).T
        pivot = seen.mean(axis=0)
        F = (whitening @ frame_motions(seen - pivot)[:, :c]).reshape(-1, 6)
        D = whitening @ by_unknowns(model, fitted)[:, :c]
        covariance = np.asarray(np.linalg.inv(F.T @ F))
        return FreeFrame(pivot, np.asarray(covariance @ (F.T @ D.reshape(len(F), -1))), covariance)

    def motions(self, model: Model, at: OperatingPoints) -> Floats:
        """(N, 6, 6) derivative of the measured poses by the frame's shift (m) and rotation (rad)."""
        return frame_motions(model.in_instrument_frame(at.poses).T - self.pivot)


@dataclass(frozen=True)
class ModelPosterior:
    """Uncertainty of a model's unknowns: geometry, effects, and a free frame.

    ``model``: an identified model. ``frame``: posterior of the instrument's frame where that is unknown; None where the
    instrument measures in the base frame.
    """

    model: Model
    frame: FreeFrame | None = None

    @cached_property
    def covariance(self) -> Floats:
        """(p + m, p + m) posterior covariance of the geometry's parameters and the effects' coefficients."""
        geometry = self.model.covariance
        assert geometry is not None
        return joined([geometry, *(active.covariance for active in self.model.effects)], self.model.joint_covariance)

    @cached_property
    def root(self) -> Floats:
        """(p + m, p + m) F with F F' the covariance."""
        return root_of(self.covariance)

    def derivatives(self, at: OperatingPoints) -> Floats:
        """(N, 6, p + m) derivative of the measured poses by the unknowns, instrument's frame. A free frame moves by -K times
        the unknowns' change."""
        D = by_unknowns(self.model, at)
        return D if self.frame is None else D - self.frame.motions(self.model, at) @ self.frame.gain

    def poses(self, at: OperatingPoints) -> Floats:
        """(N, 6, 6) covariance of the poses, m and rad."""
        half = self.derivatives(at) @ self.root
        covariance = half @ np.swapaxes(half, 1, 2)
        if self.frame is None:
            return np.asarray(covariance)
        F = self.frame.motions(self.model, at)
        return np.asarray(covariance + F @ self.frame.covariance @ np.swapaxes(F, 1, 2))


@dataclass(frozen=True)
class HeldAgainst:
    """A model compared with N measured rows.

    - ``model``: the model, with the pose of the instrument during these measurements.
    - ``measured``: the rows.
    - ``errors``: (N, c) measured less predicted, instrument's frame: position, m, and for c = 6 rotation vector, rad.
    - ``at``: the rows' commands and covariates.
    - ``noise``: noise of the instrument, and of the drives as in the model's fit.
    """

    model: Model
    measured: Measured
    errors: Floats
    at: OperatingPoints
    noise: Noise

    @staticmethod
    def of(model: Model, dataset: Dataset, noise: Noise, *, align: bool) -> HeldAgainst:
        """Compare a model with the rows of a dataset; ``align``: fit the instrument's frame to these rows first."""
        measured = measured_poses(replace(dataset, orientation=None) if model.geometry.positions_only else dataset)
        at = at_commands(model, dataset.q, dataset.covariates)
        if align:
            base = replace(model, frame=Frame()).predict(dataset.q, dataset.covariates)
            model = replace(model, frame=rough_frame(base, measured))
            predicted = model.predict(dataset.q, dataset.covariates)
            # The frame moved so that the errors are least in units of the noise.
            left, T, frame = measured.residual_at(predicted), predicted.T, model.frame
            c, pivot = left.shape[1], T.mean(axis=0)
            F = frame_motions(T - pivot)[:, :c]
            weight = 1.0 / np.array([noise.position_sigma] * 3 + [noise.orientation_sigma] * 3)[:c]
            motion, *_ = np.linalg.lstsq((F * weight[:, None]).reshape(-1, 6), (left * weight).ravel(), rcond=None)
            turn = exp(np.asarray(motion[3:], dtype=np.float64))
            model = replace(model, frame=Frame(turn @ (frame.T - pivot) + pivot + motion[:3], turn @ frame.R))
        errors = measured.residual_at(model.predict(dataset.q, dataset.covariates))
        return HeldAgainst(model, measured, errors, at, noise)

    @cached_property
    def whitening(self) -> Floats:
        """(N, c, c) whitening matrices W of the noise: W'W is the inverse of its covariance."""
        return self.noise.whitening(by_commands(self.model, self.at), self.errors.shape[1])

    @property
    def _misfit(self) -> float:
        """Root mean square of the errors in units of the noise, at least 1."""
        residual = np.einsum("nij,nj->ni", self.whitening, self.errors)
        return max(1.0, float(np.sqrt((residual**2).mean())))

    def frame(self) -> FreeFrame:
        """The instrument's free frame, as these rows determine it."""
        return FreeFrame.of(self.model, self.at, self.whitening)

    def repeatability(self, visits: npt.NDArray[np.intp]) -> float | None:
        """Repeatability of each actuator, m or rad, from the scatter of repeated visits; None with too few of them.

        Scatter that the model explains (backlash, temperature) is not part of it. ``visits``: (N,) index of each row's pose.
        """
        found, rows = contrasts(visits, self.errors)
        if len(found) < LEAST_CONTRASTS:
            return None
        J = by_commands(self.model, self.at)[rows]
        noise = replace(self.noise, repeatability=0.0).rows(*found.shape)
        return likeliest(noise, found, J, np.ones(len(found))).repeatability

    def fitted(self, posterior: ModelPosterior) -> bool:
        """Whether the model was fitted to exactly these rows.

        The score z = L' D' W'W e, with e the errors, D their derivative by the unknowns and L L' the posterior covariance, is
        nearly zero at the rows of a fit (not exactly, because of the prior). For new rows it has the covariance M + M^2 with
        M = L' D' W'W D L. The noise is at least as large as the errors: a fit with unexplained errors counts them as noise.
        """
        W, c = self.whitening / self._misfit, self.errors.shape[1]
        root = posterior.root
        D = (W @ posterior.derivatives(self.at)[:, :c]).reshape(-1, len(root)) @ root
        M = D.T @ D
        size, axes = np.linalg.eigh(M)
        score = axes.T @ (D.T @ np.einsum("nij,nj->ni", W, self.errors).ravel())
        own = size > DETERMINED * size.max()
        squares = score[own] ** 2 / (size[own] + size[own] ** 2)
        return bool(own.sum() >= FEWEST and squares.mean() < SMALL)

    def left_out(self, posterior: ModelPosterior, visits: npt.NDArray[np.intp]) -> tuple[Floats, float]:
        """Errors at poses that are left out, each with all its visits, of the fit to these rows; and its number of parameters.

        ``posterior``: uncertainty of the model that was fitted to these rows. Only its frame is used: its covariance may be
        that of another noise. ``visits``: (N,) index of each row's pose.

        Returns (N, c) errors, m and rad; and the effective number of fitted parameters.
        """
        W, c = self.whitening / self._misfit, self.errors.shape[1]
        residual = np.einsum("nij,nj->ni", W, self.errors)
        columns = by_unknowns(self.model, self.at)[:, :c] * prior_sizes(self.model, self.at)
        if posterior.frame is not None:
            columns = np.concatenate([columns, FREE * posterior.frame.motions(self.model, self.at)[:, :c]], axis=2)
        J = W @ columns
        flat = J.reshape(-1, J.shape[2])
        values, vectors = np.linalg.eigh(flat.T @ flat)
        half = J @ (vectors / np.sqrt(np.maximum(values, 0.0) + 1.0))
        out = of_poses(half, residual, visits)
        effective_parameters = float((np.maximum(values, 0.0) / (np.maximum(values, 0.0) + 1.0)).sum())
        return np.asarray(np.linalg.solve(W, out[..., None])[..., 0]), effective_parameters

    def travel(self, errors: Floats) -> Floats | None:
        """(N, n) deviations of the actuators' travel, m or rad, for errors (N, c) of poses; None where not determined."""
        J = by_commands(self.model, self.at)
        components = 3 if J.shape[2] <= 3 else errors.shape[1]
        if J.shape[2] > components:
            return None
        return np.asarray(np.einsum("nij,nj->ni", np.linalg.pinv(J[:, :components]), errors[:, :components]))


def prior_sizes(model: Model, at: OperatingPoints) -> Floats:
    """(p + m,) prior standard deviations of the geometry's parameters and the effects' coefficients.

    The scale of an effect's coefficients is not in the model: that of the fitted ones takes its place, and at least 1.
    """
    found = [model.geometry.tolerance]
    for active in model.effects:
        sigma = active.basis(replace(at, fixed=active.references)).sigma
        found.append(sigma * max(1.0, float(np.sqrt(((active.coefficients / sigma) ** 2).mean()))))
    return np.concatenate(found)


def approaches(covariates: Mapping[str, Column], n: int) -> Floats | None:
    """(N, n) directions of approach; None where not all of them were recorded."""
    names = [f"approach{i + 1}" for i in range(n)]
    if not all(name in covariates for name in names):
        return None
    return np.column_stack([np.asarray(covariates[name], dtype=float) for name in names])
