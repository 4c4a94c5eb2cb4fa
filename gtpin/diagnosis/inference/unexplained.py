"""What the causes do not explain: its size, whether noise alone could be the reason, and what it depends on."""

from __future__ import annotations

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, HypothesisSet
from gtpin.diagnosis.inference.findings import Unexplained
from gtpin.diagnosis.linear.posterior import given
from gtpin.distributions import chi2

CORRELATES = 5
"""Most smooth terms that are reported."""


def unexplained(hypotheses: HypothesisSet, model: Explanation, unknown: bool) -> Unexplained:
    """Chi-square of the residuals of a model, and the smooth terms that correlate with them.

    ``model``: the named causes. ``unknown``: whether something unknown is assumed as well.
    """
    groups, design = hypotheses.groups, hypotheses.design
    power = marginal_power(hypotheses, model)
    gram = np.vstack([np.zeros((0, len(model.mean))), *(groups.across(n, model.terms) for n in model.terms)])
    taken = float(np.einsum("ij,ji->", model.covariance, gram))
    dof = max(design.dof - taken, 1.0)
    excess = groups.power - design.dof
    correlates = []
    for smooth in hypotheses.smooth:
        if smooth in model.terms:
            continue
        own, seen = given(groups, model, smooth)
        values, vectors = np.linalg.eigh(own)
        kept = values > 1e-6 * max(float(values.max()), 1e-300)
        statistic = float(((vectors.T @ seen)[kept] ** 2 / values[kept]).sum())
        dof_ = int(kept.sum())
        row = smooth.site, smooth.words, float(chi2.sf(statistic, dof_))
        correlates.append((row[2], (dof_ - statistic) / np.sqrt(2.0 * dof_), row))  # p-values may both be 0
    share = float(np.clip((power - dof) / excess, 0.0, 1.0)) if excess > 1e-9 else 0.0
    kept_rows = tuple(row for p, _, row in sorted(correlates)[:CORRELATES] if p < hypotheses.priors.seen)
    return Unexplained(share, float(chi2.sf(power, dof)), kept_rows, _could_be(hypotheses, model) if unknown else ())


def marginal_power(hypotheses: HypothesisSet, model: Explanation) -> float:
    """Chi-square of the residual with geometry and a model's causes marginalised: y' (I + B B' + sum_k s_k^2 E_k E_k')^-1 y."""
    moment = np.concatenate([np.zeros(0), *(hypotheses.groups.moment(n) for n in model.terms)])
    return hypotheses.groups.power - float(moment @ model.mean)


def _could_be(hypotheses: HypothesisSet, model: Explanation) -> tuple[tuple[str, str], ...]:
    """Effect and site of untestable effects whose proxies gain nearly as much as the best smooth term, the best first."""
    priors = hypotheses.priors
    best = max((gain.value for gain in hypotheses.gains(model, hypotheses.smooth).values()), default=0.0)
    gains = hypotheses.gains(model, hypotheses.proxies)
    enough = [
        p
        for p in sorted(gains, key=lambda p: -gains[p].value)
        if gains[p].value >= max(priors.accounts * best, priors.surely)
    ]
    taken = {term.place for term in model.terms if isinstance(term, Hypothesis)}
    return tuple(p.hypothesis.place for p in enough if p.hypothesis.place not in taken)
