"""Causes as they are reported, with their classes and their parameters with sigmas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.findings import Cause
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import References
from gtpin.estimate import Estimate
from gtpin.model.model import Model as FittedModel
from gtpin.robot.robot import Robot

DRAWS = 150
"""Number of draws from a posterior for a parameter's sigma; as many mirrored draws are added."""
WITHIN = 0.6827
"""Share of the draws that differ from the value by less than sigma: as of a normal distribution."""


def cause(
    model: FittedModel, hypothesis: Hypothesis, found: Conclusion, named: Hypothesis, hypotheses: HypothesisSet
) -> Cause:
    """A cause ``named`` in a conclusion, with its parameters from the fitted model. Its ``explained_fraction`` is 0 at first.

    The others of its class have the parameters of a linear fit in its place.
    """
    active = next(e for e in model.effects if (e.effect.id, e.site) == hypothesis.place)
    own = next(m for m in found.classes[named] if m.hypothesis.place == hypothesis.place)
    parameters = estimates(model.robot, active, hypothesis)
    members = []
    for contender, member in zip(found.classes[named], found.members(named), strict=True):
        other, told = contender.hypothesis, parameters
        if other.place != hypothesis.place:
            alone = contender.recorded and contender.beside is None
            taken = alone and _in_its_place(hypotheses, found, named, other, active.references)
            told = estimates(model.robot, taken, other) if taken else {}
        members.append(replace(member, parameters=told))
    return Cause(*hypothesis.place, own.probability, tuple(members), parameters, 0.0, found.nature(hypothesis))


def _in_its_place(
    hypotheses: HypothesisSet, found: Conclusion, named: Hypothesis, other: Hypothesis, references: References
) -> ActiveEffect | None:
    """Another member of a cause's class in its place, by a linear fit; None where it is a cause itself."""
    terms = found.model.terms
    if other.place in {term.place for term in terms if isinstance(term, Hypothesis)}:
        return None
    model = hypotheses.of([other if term == named else term for term in terms], found.model.scale)
    start, sigma = sum(model.widths[: terms.index(named)]), other.basis(hypotheses.design.situation).sigma
    own = slice(start, start + len(sigma))
    covariance = model.covariance[own, own] * np.outer(sigma, sigma)
    return ActiveEffect(
        other.effect, other.site, other.nonlinear, model.mean[own] * sigma, covariance, references, other.further
    )


def estimates(robot: Robot, active: ActiveEffect, hypothesis: Hypothesis) -> dict[str, Estimate]:
    """Parameters by name: value at the coefficients' posterior mean, and sigma, within which 68 % of draws lie about it.

    Draws from the posterior are needed because some parameters, such as a curve's root mean square, are not linear in the
    coefficients. They are not needed for the value: a mean or a median of draws of such a norm is too large, because the
    draws add the posterior's variance to coefficients that contain the noise already.
    """
    sigmas = [sigma for _, sigma in hypothesis.lines]
    values, vectors = np.linalg.eigh(active.covariance)
    unit = np.random.default_rng(0).standard_normal((DRAWS, len(values) + max(len(active.values), 1)))
    drawn = []
    for z in np.vstack([unit, -unit]):
        c = active.coefficients + vectors @ (np.sqrt(np.maximum(values, 0.0)) * z[: len(values)])
        own = zip(active.values, sigmas, z[len(values) :], strict=False)
        places = [value + sigma * float(draw) for value, sigma, draw in own]
        drawn.append([v for v, _ in active.effect.parameters_of(robot, active.site, c, places).values()])
    said = active.effect.parameters_of(robot, active.site, active.coefficients, active.values)
    sigma = np.quantile(np.abs(np.array(drawn) - [value for value, _ in said.values()]), WITHIN, axis=0)
    return {name: Estimate(value, float(s), unit) for (name, (value, unit)), s in zip(said.items(), sigma, strict=True)}
