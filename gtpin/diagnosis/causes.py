"""Causes as they are reported: their classes, parameters with sigmas, and what each takes away of the gap."""

from __future__ import annotations

import numpy as np

from gtpin.diagnosis.candidates import Candidate
from gtpin.diagnosis.result import Cause, Member
from gtpin.effects.active import ActiveEffect
from gtpin.model import Model


def cause(model: Model, candidate: Candidate, members: tuple[Member, ...], shrinkage: float) -> Cause:
    """One cause, with the coefficients that the fitted model has for it."""
    active = next(e for e in model.effects if e.name == candidate.name)
    own = next(m for m in members if f"{m.effect}@{m.site}" == candidate.name)
    parameters = _parameters(active, candidate.setting_sigma)
    return Cause(candidate.effect.id, candidate.site, own.probability, members, parameters, shrinkage)


def _parameters(active: ActiveEffect, setting_sigma: float) -> dict[str, tuple[float, float, str]]:
    """Named parameters with sigmas, propagated from the coefficients' covariance and the setting's sigma by differences."""
    said, c, setting = active.effect.parameters, active.coefficients, active.setting
    size = np.sqrt(np.diag(active.covariance))
    found = {}
    for name, (value, unit) in said(c, setting).items():
        slope = np.zeros(len(size))
        for i, step in enumerate(size * 1e-3):
            if step > 0.0:
                slope[i] = (said(c + step * np.eye(len(size))[i], setting)[name][0] - value) / step
        variance = max(float(slope @ active.covariance @ slope), 0.0)
        if setting is not None and setting_sigma > 0.0:
            variance += (said(c, setting + 1e-3 * setting_sigma)[name][0] - value) ** 2 * 1e6
        found[name] = (value, float(variance**0.5), unit)
    return found
