"""An earlier model as the prior of a check: what it predicts of new commands, and how uncertain that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.linear.design import Design
from gtpin.effects.active import ActiveEffect, lasts, with_effects
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.errors import ModelError, unheard
from gtpin.instruments.readings import VAGUE
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp
from gtpin.model.fit_conditions import TEMPERATURES
from gtpin.model.model import Frame, Model, inverse_root
from gtpin.typing import Floats

SINCE = "since the model"
"""Session of all rows of a check: none of the sessions of the model's fit."""


@dataclass(frozen=True)
class Earlier:
    """An earlier model, without the effects that do not last: drift of the instrument, and its shifts between sessions.

    ``model``: the model as it was identified.
    """

    model: Model

    @cached_property
    def effects(self) -> tuple[ActiveEffect, ...]:
        """The lasting effects: all but those at the site ``frame`` that depend on time or session."""
        return tuple(active for active, kept in zip(self.model.effects, self._lasts, strict=True) if kept)

    @cached_property
    def _lasts(self) -> list[bool]:
        robot = self.model.robot
        return [lasts(active, robot) for active in self.model.effects]

    @cached_property
    def covariance(self) -> Floats:
        """(p + m, p + m) covariance of the p parameters of the geometry and the m coefficients of the lasting effects.

        A nominal geometry has the squares of its tolerances. Where the model has no joint covariance, its effects are
        independent.
        """
        model, p = self.model, len(self.model.geometry.parameters)
        blocks = [model.covariance if model.covariance is not None else np.diag(model.geometry.tolerance**2)]
        blocks += [active.covariance for active in model.effects]
        kept = [np.ones(p, dtype=bool)]
        kept += [np.full(len(a.coefficients), lasts) for a, lasts in zip(model.effects, self._lasts, strict=True)]
        some = np.flatnonzero(np.concatenate(kept))
        whole = model.joint_covariance
        if whole is None:
            whole = np.zeros((len(np.concatenate(kept)),) * 2)
            start = 0
            for block in blocks:
                own = slice(start, start + len(block))
                whole[own, own] = block
                start = own.stop
        return np.asarray(whole[np.ix_(some, some)])

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
                return with_effects(self.model.kinematics, q, self._then(covariates, len(q)), self.effects, plain)
            except ModelError as error:
                hint = f"record {error.column or 'it'} in the check too, as at the poses of the model"
                raise ModelError(error.what, column=error.column, hint=hint) from None

    def jacobian(self, q: Floats, covariates: Mapping[str, Column], poses: Poses) -> Floats:
        """(N, 6, p + m) derivative of the poses, base frame, by the geometry and the lasting effects' coefficients."""
        kinematics = self.model.kinematics
        columns = [kinematics.geometry_jacobian(q, poses)]
        then = self._then(covariates, len(q))
        with unheard():
            for active in self.effects:
                at = OperatingPoints(kinematics, q, poses, then, fixed=active.references)
                columns.append(active.basis(at).displacement(at))
        return np.concatenate(columns, axis=2)

    def _then(self, covariates: Mapping[str, Column], count: int) -> dict[str, Column]:
        """Covariates for the model's effects: a session that is not in its fit, and the middle of the time of its fit."""
        then = dict(covariates) | {"session": np.full(count, SINCE, dtype=object)}
        for active in self.effects:
            start, span = active.references.time
            then["time"] = np.full(count, start + span / 2.0)
        return then

    def temperature(self, name: str, reference: float) -> float | None:
        """Temperature ``name``, degC, at which the model's geometry holds; None where it is not known.

        It is ``reference`` where the model has an effect of this temperature, else the mean over the poses of its fit.
        """
        robot, fit = self.model.robot, self.model.fit
        if any(name in active.effect.covariates(robot, active.site) for active in self.effects):
            return reference
        return None if fit is None else {"temp_frame": fit.temp_frame, "temp_link": fit.temp_link}[name]

    def since(
        self, covariates: Mapping[str, Column], reference: float, count: int, warmer: float
    ) -> tuple[dict[str, Column], tuple[str, ...]]:
        """Covariates (N,) by name for effects that describe changes since the model, and the names of assumed temperatures.

        Sessions are left out: a change is the same at all poses of a check. Temperatures are those of the check less the one at
        which the model holds, plus ``reference``, degC. Where that change is not known, a rise by ``warmer``, K, is assumed:
        coefficients may have either sign, so that this includes a fall. ``count`` is N.
        """
        since = {name: values for name, values in covariates.items() if name != "session"}
        assumed = []
        for name in TEMPERATURES:
            then = self.temperature(name, reference)
            now = np.asarray(covariates[name], dtype=float) if name in covariates else np.zeros(count)
            if then is None or name not in covariates:
                assumed.append(name)
                since[name] = now - now.mean() + reference + warmer
            else:
                since[name] = now - then + reference
        return since, tuple(assumed)

    def moved(self, deviation: Floats, covariance: Floats) -> Model:
        """The model with another geometry and other coefficients of the lasting effects.

        ``deviation``: (p + m,) their change. ``covariance``: (p + m, p + m) their new covariance.
        """
        geometry, place = self.model.geometry, len(self.model.geometry.parameters)
        moved = geometry.with_values(geometry.values + deviation[:place])
        p, effects = place, []
        for active in self.effects:
            own = slice(place, place + len(active.coefficients))
            effects.append(
                replace(active, coefficients=active.coefficients + deviation[own], covariance=covariance[own, own])
            )
            place = own.stop
        return replace(
            self.model,
            geometry=moved,
            effects=tuple(effects),
            covariance=covariance[:p, :p],
            joint_covariance=covariance if effects else None,
        )


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
        J, prior = design.beside(changes)
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
    sizes = [cause.basis(design.operating_points).sigma * s for cause, s in zip(causes, scale, strict=True)]
    whole = np.zeros((len(earlier.root) + sum(map(len, sizes)), len(found.mean)))
    whole[: len(earlier.root), :k] = earlier.root
    whole[len(earlier.root) :, after:] = np.diag(np.concatenate([np.zeros(0), *sizes]))
    moved, covariance = whole @ found.mean, whole @ found.covariance @ whole.T
    active, place, known = [], len(earlier.root), design.operating_points.references
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
    pivot = design.model.in_instrument_frame(design.operating_points.poses).T.mean(axis=0)
    turn = exp(change[3:])
    return Frame(pivot + change[:3] + turn @ (frame.T - pivot), turn @ frame.R)
