"""Uncertainty of a model's predictions: its posterior propagated to poses, in the instrument's frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtpin.effects.situation import Column, Situation
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import frame_motions
from gtpin.model.model import Model, in_frame, joined, root_of
from gtpin.typing import Floats


@dataclass(frozen=True)
class At:
    """N commands with covariates, at which a model is compared with the machine.

    ``q``: (N, n) commands, m or rad. ``covariates``: (N,) values of each covariate, by name. ``plain``: the N poses of the
    model's geometry without effects, base frame.
    """

    q: Floats
    covariates: Mapping[str, Column]
    plain: Poses

    @staticmethod
    def of(model: Model, q: Floats, covariates: Mapping[str, Column]) -> At:
        """N commands that the model can reach, with their poses."""
        return At(q, covariates, model.kinematics.forward(q))


def by_unknowns(model: Model, at: At) -> Floats:
    """(N, 6, p + m) derivative of the poses, instrument's frame, m and rad, by the p geometric parameters and the effects' m
    coefficients."""
    kinematics = model.kinematics
    columns = [kinematics.geometry_jacobian(at.q, at.plain)[:, :6]]
    for active in model.effects:
        situation = Situation(kinematics, at.q, at.plain, at.covariates, fixed=active.references)
        columns.append(active.basis(situation).displacement(situation)[:, :6])
    return in_frame(np.concatenate(columns, axis=2), model.frame)


def by_commands(model: Model, at: At) -> Floats:
    """(N, 6, n) derivative of the poses by the commands, instrument's frame, m and rad."""
    return in_frame(model.kinematics.command_jacobian(at.q, at.plain)[:, :6], model.frame)


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
    def of(model: Model, fitted: At, whitening: Floats) -> FreeFrame:
        """The frame's posterior from the poses of a fit; whitening (N, c, c) of their c = 3 or 6 components."""
        c = whitening.shape[1]
        seen = model.seen(fitted.plain).T
        pivot = seen.mean(axis=0)
        F = (whitening @ frame_motions(seen - pivot)[:, :c]).reshape(-1, 6)
        D = whitening @ by_unknowns(model, fitted)[:, :c]
        covariance = np.asarray(np.linalg.inv(F.T @ F))
        return FreeFrame(pivot, np.asarray(covariance @ (F.T @ D.reshape(len(F), -1))), covariance)

    def motions(self, model: Model, at: At) -> Floats:
        """(N, 6, 6) derivative of the measured poses by the frame's shift (m) and rotation (rad)."""
        return frame_motions(model.seen(at.plain).T - self.pivot)


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

    def derivatives(self, at: At) -> Floats:
        """(N, 6, p + m) derivative of the measured poses by the unknowns, instrument's frame. A free frame moves by -K times
        the unknowns' change."""
        D = by_unknowns(self.model, at)
        return D if self.frame is None else D - self.frame.motions(self.model, at) @ self.frame.gain

    def poses(self, at: At) -> Floats:
        """(N, 6, 6) covariance of the poses, m and rad."""
        half = self.derivatives(at) @ self.root
        covariance = half @ np.swapaxes(half, 1, 2)
        if self.frame is None:
            return np.asarray(covariance)
        F = self.frame.motions(self.model, at)
        return np.asarray(covariance + F @ self.frame.covariance @ np.swapaxes(F, 1, 2))
