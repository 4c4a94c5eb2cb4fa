"""Geometry and causes fitted together with exact kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.linear.observed import Observed
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.situation import References
from gtpin.errors import ConvergenceError
from gtpin.kinematics.chunks import chunks
from gtpin.kinematics.rotations import exp
from gtpin.model.model import Frame, Model

Floats = npt.NDArray[np.float64]

MAX_STEPS = 12
SETTLED = 1e-3
"""Step, in tolerances and typical sizes, at which the fit has settled."""


def fit_together(
    observed: Observed, start: Model, causes: Sequence[Hypothesis], scale: Sequence[float], references: References
) -> Model:
    """Gauss-Newton on geometry, instrument's pose and coefficients, from a calibrated model.

    Parameters
    ----------
    causes, scale
        The causes, and their scales over the typical size: with it the priors of their coefficients.

    Raises
    ------
    ConvergenceError
        If it does not settle.
    """
    model = replace(start, effects=())
    p = len(model.geometry.parameters)
    c = np.zeros(0)
    for _ in range(MAX_STEPS):
        now = _linear(observed, model, causes, scale, references)
        first = len(now.gradient) - sum(now.widths)  # of the causes
        if not c.size:
            c = np.zeros(sum(now.widths))
        x = model.geometry.deviation / model.geometry.tolerance
        prior = np.concatenate([np.ones(p), np.zeros(first - p), np.ones(len(c))])
        A = now.information + np.diag(prior)
        step = np.linalg.solve(A, now.gradient - prior * np.concatenate([x, np.zeros(first - p), c]))
        joint: Floats = np.asarray(np.linalg.inv(A), dtype=np.float64)
        tolerance = model.geometry.tolerance
        c = c + step[first:]
        geometry = model.geometry.with_values(model.geometry.values + tolerance * step[:p])
        frame = _moved(model.frame, step[p:first], now.pivot)
        active = _active(causes, now.sizes, now.widths, c, joint[first:, first:], references)
        model = Model(geometry, frame, active, joint[:p, :p] * np.outer(tolerance, tolerance))
        if np.abs(step).max(initial=0.0) <= SETTLED:
            return model
    raise ConvergenceError("geometry and causes have not settled together", hint="exclude the causes one by one")


@dataclass(frozen=True)
class _Linear:
    """J'J and J'r about a model (columns: geometry, instrument's pose, causes), and what the columns were made with.

    ``sizes`` are those of each cause's coefficients, ``widths`` how many it has; ``pivot`` (3,) is what a free instrument
    turns about, in its frame, m.
    """

    information: Floats
    gradient: Floats
    sizes: list[Floats]
    widths: list[int]
    pivot: Floats


def _linear(
    observed: Observed, model: Model, causes: Sequence[Hypothesis], scale: Sequence[float], references: References
) -> _Linear:
    """Sum up chunks of poses: all their derivatives at once would take kilobytes a pose."""
    kinematics, q = model.kinematics, observed.measured.q
    poses = kinematics.forward(q)
    pivot = model.seen(poses).T.mean(axis=0)
    information: Floats | float = 0.0
    gradient: Floats | float = 0.0
    for rows in chunks(len(q)):
        part = observed.take(rows)
        design = part.design(model, references, poses[rows], pivot)
        bases = [cause.basis(design.situation) for cause in causes]
        blocks = [design.columns(b) * s for b, s in zip(bases, scale, strict=True)]
        predicted = model.seen(with_effects(kinematics, q[rows], part.covariates, model.effects, poses[rows]))
        # y is against the geometry alone; the exact effects replace their linear part, which is put back.
        left = np.einsum("nij,nj->ni", design.whitening, part.measured.minus(predicted)).ravel()
        J = np.hstack([design.B, *blocks])
        information, gradient = information + J.T @ J, gradient + J.T @ left
    sizes = [basis.sigma * s for basis, s in zip(bases, scale, strict=True)]
    return _Linear(np.asarray(information), np.asarray(gradient), sizes, [len(basis) for basis in bases], pivot)


def _active(
    causes: Sequence[Hypothesis],
    sizes: Sequence[Floats],
    widths: Sequence[int],
    c: Floats,
    covariance: Floats,
    references: References,
) -> tuple[ActiveEffect, ...]:
    found, place = [], 0
    for cause, size, width in zip(causes, sizes, widths, strict=True):
        own = slice(place, place + width)
        place += width
        found.append(
            ActiveEffect(
                cause.effect,
                cause.site,
                cause.nonlinear,
                c[own] * size,
                covariance[own, own] * np.outer(size, size),
                references,
            )
        )
    return tuple(found)


def _moved(frame: Frame, step: Floats, pivot: Floats) -> Frame:
    """A free instrument's frame after a step: shifts, m, and turns, rad, about the middle of the poses."""
    if not step.size:
        return frame
    turn = exp(step[3:])
    return Frame(pivot + step[:3] + turn @ (frame.T - pivot), turn @ frame.R)
