"""An earlier model as the prior of a check: what it predicts of new commands, and how uncertain that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.effects.active import ActiveEffect, lasts, with_effects
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.errors import ModelError, unheard
from gtpin.instruments.readings import VAGUE
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp
from gtpin.model.fit_conditions import EXPLAINED, TEMPERATURES, ModelDiscrepancy
from gtpin.model.model import Frame, Model, inverse_root, joined
from gtpin.typing import Floats

SINCE = "since the model"
"""Session of all rows of a check: none of the sessions of the model's fit."""


@dataclass(frozen=True)
class Earlier:
    """An earlier model ``model``, as it was identified, as the prior of a check."""

    model: Model

    @cached_property
    def lasting(self) -> Model:
        """The model without the effects that do not last: drift of the instrument, and its shifts between sessions."""
        robot = self.model.robot
        return self.model.without([active.name for active in self.model.effects if not lasts(active, robot)])

    @property
    def unexplained(self) -> ModelDiscrepancy:
        """What the model left unexplained of its own data: a part of the uncertainty of every prediction."""
        return self.model.unexplained or EXPLAINED

    @cached_property
    def covariance(self) -> Floats:
        """(p + m, p + m) covariance of the p parameters of the geometry and the m coefficients of the lasting effects.

        A nominal geometry has the squares of its tolerances. Where the model has no joint covariance, its effects are
        independent.
        """
        model = self.lasting
        known = np.diag(model.geometry.tolerance**2) if model.covariance is None else model.covariance
        return joined([known, *(active.covariance for active in model.effects)], model.joint_covariance)

    @cached_property
    def root(self) -> Floats:
        """(p + m, k) with root @ root' the covariance: the uncertainty as k standard normal unknowns."""
        values, vectors = np.linalg.eigh(self.covariance)
        kept = values > 1e-14 * max(float(values.max()), 1e-300)
        return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))

    def predicted(self, q: Floats, covariates: Mapping[str, Column], plain: Poses) -> Poses:
        """Poses (N) that the model predicts at commands q (N, n), base frame; ``plain`` are those of its geometry alone.

        Raises `ModelError` if a covariate is missing that an effect needs.
        """
        with unheard():  # sessions of a check are never those of the model
            try:
                return with_effects(
                    self.model.kinematics, q, self._then(covariates, len(q)), self.lasting.effects, plain
                )
            except ModelError as error:
                hint = f"record {error.column or 'it'} in the check too, as at the poses of the model"
                raise ModelError(error.what, column=error.column, hint=hint) from None

    def jacobian(self, q: Floats, covariates: Mapping[str, Column], poses: Poses) -> Floats:
        """(N, 6, p + m) derivative of the poses, base frame, by the geometry and the lasting effects' coefficients."""
        kinematics = self.model.kinematics
        columns = [kinematics.geometry_jacobian(q, poses)]
        then = self._then(covariates, len(q))
        with unheard():
            for active in self.lasting.effects:
                at = OperatingPoints(kinematics, q, poses, then, fixed=active.references)
                columns.append(active.basis(at).displacement(at))
        return np.concatenate(columns, axis=2)

    def _then(self, covariates: Mapping[str, Column], count: int) -> dict[str, Column]:
        """Covariates for the model's effects: a session that is not in its fit, and the middle of the time of its fit."""
        then = dict(covariates) | {"session": np.full(count, SINCE, dtype=object)}
        for active in self.lasting.effects:
            start, span = active.references.time
            then["time"] = np.full(count, start + span / 2.0)
        return then

    def since(
        self, covariates: Mapping[str, Column], reference: float, count: int, warmer: float
    ) -> tuple[dict[str, Column], tuple[str, ...]]:
        """Covariates (N,) by name for effects that describe changes since the model, and the names of assumed temperatures.

        Sessions are left out: a change is the same at all poses of a check. Temperatures are those of the check less the one at
        which the model holds, plus ``reference``, degC. It holds at ``reference`` where it has an effect of this temperature,
        else at the mean over the poses of its fit. Where the change is not known, a rise by ``warmer``, K, is assumed:
        coefficients may have either sign, so that this includes a fall. ``count`` is N.
        """
        since = {name: values for name, values in covariates.items() if name != "session"}
        robot, assumed = self.model.robot, []
        for name in TEMPERATURES:
            has_effect = any(name in one.effect.covariates(robot, one.site) for one in self.lasting.effects)
            then: float | None = reference if has_effect else getattr(self.model.fit, name, None)
            now = np.asarray(covariates[name], dtype=float) if name in covariates else np.zeros(count)
            if then is None or name not in covariates:
                assumed.append(name)
                since[name] = now - now.mean() + reference + warmer
            else:
                since[name] = now - then + reference
        return since, tuple(assumed)


def _posterior(design: Design, changes: Floats) -> tuple[Floats, Floats, Floats]:
    """The Gaussian posterior of all k unknowns of a check, in units of their prior standard deviations.

    These are the model's unknowns, then the instrument's pose, then the coefficients of changes with the whitened displacements
    ``changes`` (N c, m). Returns their mean (k,) and covariance (k, k), and the derivative (N c, k) of y by them.
    """
    J, prior = design.beside(changes)
    root = inverse_root(J.T @ J + np.diag(prior))
    covariance = root @ root.T
    return covariance @ (J.T @ design.y), covariance, J


def pose_chi2(design: Design, changes: Floats) -> Floats:
    """(N,) chi-square of each pose given all other poses, with c degrees of freedom, the number of components of a pose.

    It is r' Q^-1 r with r the pose's rows of K^-1 y, Q the pose's block of K^-1, and K the covariance of y.
    """
    mean, covariance, J = _posterior(design, changes)
    c = design.components
    left, half = (design.y - J @ mean).reshape(-1, c), J.reshape(-1, c, J.shape[1])
    Q = np.eye(c) - half @ covariance @ half.swapaxes(1, 2)
    return np.asarray(np.einsum("ni,ni->n", left, np.linalg.solve(Q, left[..., None])[..., 0]))


def updated(
    earlier: Earlier, design: Design, causes: Sequence[Hypothesis], scale: Sequence[float], columns: Floats
) -> tuple[Model, tuple[ActiveEffect, ...]]:
    """The earlier model with the changes added, fitted again with the check's poses; and the changes with their coefficients.

    ``scale``: of each change. ``columns``: (N c, m) whitened displacements of all changes at these scales.
    """
    mean, unknown, _ = _posterior(design, columns)
    at, (n, k), after = design.operating_points, earlier.root.shape, design.B.shape[1]
    sizes = [cause.basis(at).sigma * s for cause, s in zip(causes, scale, strict=True)]
    whole = np.zeros((n + sum(map(len, sizes)), len(mean)))
    whole[:n, :k] = earlier.root
    whole[n:, after:] = np.diag(np.concatenate([np.zeros(0), *sizes]))
    moved, covariance = whole @ mean, whole @ unknown @ whole.T
    geometry, p = earlier.model.geometry, len(earlier.model.geometry.parameters)
    new = [
        ActiveEffect(cause.effect, cause.site, None, np.zeros(len(size)), np.zeros(0), at.references)
        for cause, size in zip(causes, sizes, strict=True)
    ]
    effects, place = list[ActiveEffect](), p
    for active in (*earlier.lasting.effects, *new):
        own = slice(place, place + len(active.coefficients))
        place = own.stop
        coefficients = active.coefficients + moved[own]
        effects.append(replace(active, coefficients=coefficients, covariance=covariance[own, own]))
    readings = design.measured
    unknowns = mean[k : design.n_prior] * np.where(np.isfinite(readings.sigma), readings.sigma, VAGUE)
    model = replace(
        earlier.model,
        geometry=geometry.with_values(geometry.values + moved[:p]),
        frame=_frame(design, mean[design.n_prior : after]),
        effects=tuple(effects),
        covariance=covariance[:p, :p],
        instruments=readings.at(unknowns).fitted or earlier.model.instruments,
        joint_covariance=covariance if effects else None,
    )
    return model, model.effects[len(effects) - len(new) :]


def _frame(design: Design, change: Floats) -> Frame:
    """The instrument's pose with a change of shift, m, and turn, rad, about the middle of the poses."""
    frame = design.model.frame
    if not change.size:
        return frame
    pivot = design.model.in_instrument_frame(design.operating_points.poses).T.mean(axis=0)
    turn = exp(change[3:])
    return Frame(pivot + change[:3] + turn @ (frame.T - pivot), turn @ frame.R)
