"""An earlier model as the prior of a check: what it predicts of new commands, and how uncertain that is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gtpin.effects.active import ActiveEffect, lasts, with_effects
from gtpin.effects.situation import Column, Situation
from gtpin.errors import ModelError, unheard
from gtpin.kinematics.poses import Poses
from gtpin.model.fit_conditions import TEMPERATURES
from gtpin.model.model import Model
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
                at = Situation(kinematics, q, poses, then, fixed=active.references)
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
