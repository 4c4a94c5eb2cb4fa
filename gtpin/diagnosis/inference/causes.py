"""Causes as they are reported: their classes, parameters with sigmas, and what each takes away of the gap."""

from __future__ import annotations

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Candidate
from gtpin.diagnosis.result import Cause, Member
from gtpin.effects.active import ActiveEffect
from gtpin.estimate import Estimate
from gtpin.model.model import Model

DRAWS = 150
"""Draws from a posterior behind a parameter's sigma, and as many opposite ones."""


def cause(model: Model, candidate: Candidate, members: tuple[Member, ...], shrinkage: float) -> Cause:
    """One cause, with the coefficients that the fitted model has for it."""
    active = next(e for e in model.effects if e.name == candidate.name)
    own = next(m for m in members if f"{m.effect}@{m.site}" == candidate.name)
    parameters = _parameters(active, candidate.setting_sigma)
    return Cause(candidate.effect.id, candidate.site, own.probability, members, parameters, shrinkage)


def _parameters(active: ActiveEffect, setting_sigma: float) -> dict[str, Estimate]:
    """Named parameters with sigmas: middle and half width of the central 68 % over draws from the coefficients' posterior.

    A size, such as a curve's root mean square, is no linear function of coefficients: noise alone makes it larger than zero.
    """
    values, vectors = np.linalg.eigh(active.covariance)
    unit = np.random.default_rng(0).standard_normal((DRAWS, len(values) + 1))
    drawn = []
    for z in np.vstack([unit, -unit]):
        c = active.coefficients + vectors @ (np.sqrt(np.maximum(values, 0.0)) * z[:-1])
        setting = None if active.setting is None else active.setting + setting_sigma * float(z[-1])
        drawn.append([value for value, _ in active.effect.parameters(c, setting).values()])
    low, middle, high = np.quantile(drawn, (0.1587, 0.5, 0.8413), axis=0)
    said = active.effect.parameters(active.coefficients, active.setting)
    return {
        name: Estimate(float(middle[i]), float(high[i] - low[i]) / 2.0, unit)
        for i, (name, (_, unit)) in enumerate(said.items())
    }
