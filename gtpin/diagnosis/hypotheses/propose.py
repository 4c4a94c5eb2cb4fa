"""Which effects a dataset can test, and why it can't test the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gtpin.diagnosis.hypotheses.common_motions import common_motions
from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.hypotheses.merged_sessions import merged_sessions
from gtpin.diagnosis.hypotheses.scope import Scope
from gtpin.diagnosis.hypotheses.smooth_terms import smooth_terms
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import Marginal
from gtpin.diagnosis.priors import Priors
from gtpin.effects.untestable import Untestable, as_untestable


@dataclass(frozen=True)
class Untested:
    """A hypothesis that these data can't test, and why."""

    hypothesis: Hypothesis
    reason: Untestable


@dataclass(frozen=True)
class Proposal:
    """What may explain the residuals of a linear problem, and what these data can't test."""

    hypotheses: HypothesisSet
    untested: tuple[Untested, ...]

    @property
    def design(self) -> Design:
        """The linear problem."""
        return self.hypotheses.design


def propose(design: Design, scope: Scope) -> Proposal:
    """Divide the effects of a scope, at all their sites, into those that the data can test and those that they can't."""
    at = design.situation
    marginal = Marginal(design.B)
    linear: list[Hypothesis] = []
    scanned: list[Hypothesis] = []
    untested: list[Untested] = []
    for hypothesis in scope.hypotheses(at.robot):
        effect, site = hypothesis.effect, hypothesis.site
        reason = as_untestable(effect.untestable(at, site))
        many = reason is None and len(effect.nonlinear_values(at, site)) > 0
        if reason is None and not many and _absorbed(design, marginal, hypothesis, scope.priors):
            reason = Untestable("absorbed")
        if reason:
            untested.append(Untested(hypothesis, reason))
        else:
            (scanned if many else linear).append(hypothesis)
    design, odds = merged_sessions(design, marginal, linear, scope.priors)
    at = design.situation
    scaled = any(hypothesis.effect.stretches_frame for hypothesis in linear)
    smooth = (*smooth_terms(at, scope.priors), *common_motions(at, scope.priors, scaled=scaled))
    others: Sequence[Hypothesis] = [u.hypothesis for u in untested]
    return Proposal(HypothesisSet(design, linear, scanned, smooth, scope, others, of_sessions=odds), tuple(untested))


def _absorbed(design: Design, marginal: Marginal, hypothesis: Hypothesis, priors: Priors) -> bool:
    """Whether the geometry absorbs nearly all of an effect, even of one ``priors.large`` times its typical size."""
    X = design.columns(hypothesis.basis(design.situation)) * priors.large
    return float(np.trace(marginal.product(X, X))) <= priors.shows
