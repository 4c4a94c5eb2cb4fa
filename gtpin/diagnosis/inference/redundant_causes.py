"""Redundant causes: one cause whose covariate was not recorded is not reported as two."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet, Model, causes
from gtpin.diagnosis.hypotheses.proxies import Proxy
from gtpin.diagnosis.inference.verdict import Contender
from gtpin.diagnosis.linear.exchange import without


def without_redundant(
    hypotheses: HypothesisSet, named: Model, members: Callable[[Model, Hypothesis], Iterable[Contender]]
) -> Model:
    """The model without causes that are not needed when an effect with a missing covariate replaces a stronger cause.

    A testable effect that looks like an effect with a missing covariate explains only a part of it, and a second effect may
    explain the rest. If the first cause may be the effect with the missing covariate, the second has nothing to explain. The
    same holds if the second may be that effect. The effect with the missing covariate is represented by its proxy.

    Parameters
    ----------
    named
        The model of the named causes.
    members
        Function that gives the class of a cause of a model.
    """
    strength = {c: named.log_evidence - without(hypotheses.groups, named, c).log_evidence for c in causes(named)}
    for cause in sorted(strength, key=lambda c: -strength[c]):
        if cause not in named.terms:
            continue
        unrecorded = {m.hypothesis.place for m in members(named, cause) if not m.recorded}
        for proxy in [proxy for proxy in hypotheses.proxies if proxy.hypothesis.place in unrecorded]:
            weaker = [c for c in causes(named) if strength[c] < strength[cause]]
            redundant = [
                c
                for c in weaker
                if proxy.hypothesis.place in {m.hypothesis.place for m in members(named, c)}
                or _redundant(hypotheses, named, cause, proxy, c)
            ]
            named = hypotheses.only(named, (t for t in named.terms if t not in redundant))
    return named


def _redundant(hypotheses: HypothesisSet, named: Model, cause: Hypothesis, proxy: Proxy, other: Hypothesis) -> bool:
    """Whether ``other`` gains less than the prior odds against it when ``proxy`` takes the place of ``cause``."""
    rest = without(hypotheses.groups, named, cause)
    less = without(hypotheses.groups, rest, other)
    with_other = rest.log_evidence + hypotheses.gains(rest, (proxy,))[proxy].value
    alone = less.log_evidence + hypotheses.gains(less, (proxy,))[proxy].value
    return with_other - alone < hypotheses.costs(named.terms)[other]
