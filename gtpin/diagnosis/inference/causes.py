"""Causes as they are reported, with their classes and their parameters with sigmas."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.inference.findings import Cause
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.effects.active import ActiveEffect
from gtpin.estimate import Estimate
from gtpin.model.model import Model as FittedModel
from gtpin.robot.robot import Robot

DRAWS = 150
"""Number of draws from a posterior for a parameter's sigma; as many mirrored draws are added."""
WITHIN = 0.6827
"""Share of the draws that differ from the value by less than sigma: as of a normal distribution."""


def cause(model: FittedModel, hypothesis: Hypothesis, found: Conclusion, named: Hypothesis) -> Cause:
    """A cause ``named`` in a conclusion, with its parameters from the fitted model; ``shrinkage`` is 0 until it is computed."""
    active = next(e for e in model.effects if (e.effect.id, e.site) == hypothesis.place)
    own = next(m for m in found.classes[named] if m.hypothesis.place == hypothesis.place)
    parameters = _parameters(model.robot, active, [sigma for _, sigma in hypothesis.lines])
    return Cause(*hypothesis.place, own.probability, found.members(named), parameters, 0.0, found.nature(hypothesis))


def _parameters(robot: Robot, active: ActiveEffect, nonlinear_sigmas: Sequence[float]) -> dict[str, Estimate]:
    """Parameters by name: value at the coefficients' posterior mean, and sigma, within which 68 % of draws lie about it.

    Draws from the posterior are needed because some parameters, such as a curve's root mean square, are not linear in the
    coefficients. They are not needed for the value: a mean or a median of draws of such a norm is too large, because the
    draws add the posterior's variance to coefficients that contain the noise already.
    """
    values, vectors = np.linalg.eigh(active.covariance)
    unit = np.random.default_rng(0).standard_normal((DRAWS, len(values) + max(len(active.values), 1)))
    drawn = []
    for z in np.vstack([unit, -unit]):
        c = active.coefficients + vectors @ (np.sqrt(np.maximum(values, 0.0)) * z[: len(values)])
        own = zip(active.values, nonlinear_sigmas, z[len(values) :], strict=False)
        places = [value + sigma * float(draw) for value, sigma, draw in own]
        drawn.append([v for v, _ in active.effect.parameters_of(robot, active.site, c, places).values()])
    said = active.effect.parameters_of(robot, active.site, active.coefficients, active.values)
    sigma = np.quantile(np.abs(np.array(drawn) - [value for value, _ in said.values()]), WITHIN, axis=0)
    return {name: Estimate(value, float(s), unit) for (name, (value, unit)), s in zip(said.items(), sigma, strict=True)}
