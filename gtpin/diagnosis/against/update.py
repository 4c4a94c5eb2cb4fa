"""An earlier model updated with the poses of a check: geometry, its effects, the instrument's pose, and the changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.diagnosis.against.earlier import Earlier
from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.linear.design import Design
from gtpin.effects.active import ActiveEffect
from gtpin.instruments.readings import VAGUE
from gtpin.kinematics.rotations import exp
from gtpin.model.model import Frame, Model, inverse_root
from gtpin.typing import Floats


@dataclass(frozen=True)
class Linear:
    """The Gaussian posterior of all k unknowns of a check, in units of their prior standard deviations.

    ``mean``, ``covariance``: (k,) and (k, k), for the model's unknowns, then the instrument's pose, then the changes'
    coefficients. ``left``: (N, c) whitened residuals at the mean.
    """

    mean: Floats
    covariance: Floats
    left: Floats

    @staticmethod
    def of(design: Design, changes: Floats) -> Linear:
        """The posterior for changes with the whitened displacements ``changes`` (N c, m), in units of their priors' sigmas."""
        J = np.hstack([design.B, changes])
        prior = np.concatenate([design.prior, np.ones(changes.shape[1])])
        root = inverse_root(J.T @ J + np.diag(prior))
        covariance = root @ root.T
        mean = covariance @ (J.T @ design.y)
        return Linear(mean, covariance, (design.y - J @ mean).reshape(-1, design.components))


def pose_chi2(design: Design, changes: Floats) -> Floats:
    """(N,) chi-square of each pose given all other poses, with c degrees of freedom, the number of components of a pose.

    It is r' Q^-1 r with r the pose's rows of K^-1 y, Q the pose's block of K^-1, and K the covariance of y.
    """
    J, c = np.hstack([design.B, changes]), design.components
    found = Linear.of(design, changes)
    half = J.reshape(-1, c, J.shape[1])
    Q = np.eye(c) - half @ found.covariance @ half.swapaxes(1, 2)
    return np.asarray(np.einsum("ni,ni->n", found.left, np.linalg.solve(Q, found.left[..., None])[..., 0]))


def updated(
    earlier: Earlier, design: Design, causes: Sequence[Hypothesis], scale: Sequence[float], columns: Floats
) -> tuple[Model, tuple[ActiveEffect, ...]]:
    """The earlier model with the changes added, fitted again with the check's poses; and the changes with their coefficients.

    ``design``: the linear problem of the check. ``causes``, ``scale``: the changes, and the
    scale of each. ``columns``: (N c, m) whitened displacements of all changes at these scales.
    """
    found, k = Linear.of(design, columns), earlier.root.shape[1]
    after = design.B.shape[1]
    sizes = [cause.basis(design.situation).sigma * s for cause, s in zip(causes, scale, strict=True)]
    whole = np.zeros((len(earlier.root) + sum(map(len, sizes)), len(found.mean)))
    whole[: len(earlier.root), :k] = earlier.root
    whole[len(earlier.root) :, after:] = np.diag(np.concatenate([np.zeros(0), *sizes]))
    moved, covariance = whole @ found.mean, whole @ found.covariance @ whole.T
    active, place, known = [], len(earlier.root), design.situation.references
    for cause, size in zip(causes, sizes, strict=True):
        own = slice(place, place + len(size))
        place = own.stop
        active.append(ActiveEffect(cause.effect, cause.site, None, moved[own], covariance[own, own], known))
    n = len(earlier.root)
    model = replace(
        earlier.moved(moved[:n], covariance[:n, :n]), frame=_frame(design, found.mean[design.n_prior : after])
    )
    readings, unknowns = design.measured, found.mean[k : design.n_prior]
    unknowns = unknowns * np.where(np.isfinite(readings.sigma), readings.sigma, VAGUE)
    model = replace(model, instruments=readings.at(unknowns).fitted or model.instruments)
    effects = (*model.effects, *active)
    return replace(model, effects=effects, joint_covariance=covariance if effects else None), tuple(active)


def _frame(design: Design, change: Floats) -> Frame:
    """The instrument's pose with a change of shift, m, and turn, rad, about the middle of the poses."""
    frame = design.model.frame
    if not change.size:
        return frame
    pivot = design.model.seen(design.situation.poses).T.mean(axis=0)
    turn = exp(change[3:])
    return Frame(pivot + change[:3] + turn @ (frame.T - pivot), turn @ frame.R)
