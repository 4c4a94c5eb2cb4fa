"""What may have changed since an earlier model: effects at their sites, and why a check can't test some of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.hypotheses.propose import Untested
from gtpin.diagnosis.hypotheses.proxies import Proxy
from gtpin.diagnosis.hypotheses.scope import Scope
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import Marginal
from gtpin.diagnosis.priors import Priors
from gtpin.effects.situation import Column, Situation
from gtpin.effects.untestable import Untestable, as_untestable
from gtpin.health.earlier import Earlier
from gtpin.model.fit_conditions import TEMPERATURES


class Tested(HypothesisSet):
    """The hypothesis set of a check: named effects only, without smooth terms and proxies."""

    @property
    def proxies(self) -> tuple[Proxy, ...]:
        """Empty: a check has no proxies."""
        return ()

    def at_threshold(self, threshold: float, scope: Scope) -> Tested:
        """The same hypotheses, with the gain in log evidence, nats, that each must exceed to be named."""
        return Tested(self.design, self.linear, (), (), scope, (), threshold)


@dataclass(frozen=True)
class Changes:
    """The changes that a check can name, and those that it can't test.

    Parameters
    ----------
    hypotheses
        The hypotheses that it tests.
    untested
        The hypotheses that it can't test, and why.
    assumed
        Names of the temperatures whose change since the earlier model is not known and therefore assumed.
    """

    hypotheses: Tested
    untested: tuple[Untested, ...]
    assumed: tuple[str, ...]

    def is_assumed(self, hypothesis: Hypothesis) -> bool:
        """Whether a hypothesis depends on a covariate whose change is assumed."""
        robot = self.hypotheses.design.situation.robot
        return bool(set(hypothesis.covariates(robot)) & set(self.assumed))


@dataclass(frozen=True)
class Since:
    """The covariates of a check, as they are needed for effects that describe changes since an earlier model.

    Parameters
    ----------
    covariates
        By name, (N,) each. Sessions are left out: a change is the same at all poses of a check. Temperatures are those of the
        check less the one at which the earlier model holds, plus the reference temperature.
    assumed
        Names of the temperatures whose change since the earlier model is not known. A rise is assumed; since the effects'
        coefficients may have either sign, this includes a fall.
    """

    covariates: Mapping[str, Column]
    assumed: tuple[str, ...]

    @staticmethod
    def of(covariates: Mapping[str, Column], earlier: Earlier, reference: float, count: int, warmer: float) -> Since:
        """The covariates of changes, from those of a check of N poses.

        Parameters
        ----------
        reference
            Reference temperature of the dataset, degC.
        count
            N, the number of poses.
        warmer
            Assumed rise, K, of temperatures whose change is not known.
        """
        since = {name: values for name, values in covariates.items() if name != "session"}
        assumed = []
        for name in TEMPERATURES:
            then = earlier.temperature(name, reference)
            now = np.asarray(covariates[name], dtype=float) if name in covariates else np.zeros(count)
            if then is None or name not in covariates:
                assumed.append(name)
                since[name] = now - now.mean() + reference + warmer
            else:
                since[name] = now - then + reference
        return Since(since, tuple(assumed))


def changes(design: Design, scope: Scope, assumed: tuple[str, ...] = ()) -> Changes:
    """Divide the effects of a scope, at all their sites, into those that a check can test and those that it can't."""
    at, marginal = design.situation, Marginal(design.B)
    tested: list[Hypothesis] = []
    untested: list[Untested] = []
    for hypothesis in scope.hypotheses(at.robot):
        reason = _reason(at, hypothesis)
        if reason is None and not _shows(design, marginal, hypothesis, scope.priors):
            reason = Untestable("uncertain")
        if reason is None:
            tested.append(hypothesis)
        else:
            untested.append(Untested(hypothesis, reason))
    return Changes(Tested(design, tested, (), (), scope), tuple(untested), assumed)


def _reason(at: Situation, hypothesis: Hypothesis) -> Untestable | None:
    effect, site = hypothesis.effect, hypothesis.site
    if effect.since_a_model:
        return None
    if effect.has_nonlinear:
        return Untestable("not_searched")
    reason = as_untestable(effect.untestable(at, site))
    if reason is not None and reason.kind == "constant" and reason.covariate in TEMPERATURES:
        return None
    return reason


def _shows(design: Design, marginal: Marginal, hypothesis: Hypothesis, priors: Priors) -> bool:
    """Whether an effect of ``priors.large`` times its typical size shows beyond the model's uncertainty and the instrument's
    pose."""
    X = design.columns(hypothesis.basis(design.situation)) * priors.large
    return float(np.trace(marginal.product(X, X))) > priors.shows
