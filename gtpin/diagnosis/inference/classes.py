"""The class of a cause: every hypothesis that could be the cause in its place, with its probability."""

from __future__ import annotations

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis, SmoothTerm
from gtpin.diagnosis.hypotheses.hypothesis_set import UNNAMED, HypothesisSet, Model, Term
from gtpin.diagnosis.inference.verdict import Contender
from gtpin.diagnosis.linear.evidence import without

CLASS_SHARE = 0.05
"""Share of the leader's probability from which an effect belongs to its class."""
TEMPERATURE, WARMING, WARMEST = 2.0, 0.004, 6.0
"""Gains in log evidence are divided by this, and by a share of the evidence at stake, before they become probabilities: cores
are never exactly the machine's, and that shows the more the better it is seen."""
DEPARTURE, BENDING = 0.025, 0.06
"""Share of what smooth terms explain, by which they must be ahead of named causes, which depart from their cores by as much;
the second where the terms are a named cause's own modulation."""


def contenders(hypotheses: HypothesisSet, model: Model, cause: Hypothesis) -> tuple[Contender, ...]:
    """The class of a cause, the likeliest first; a smooth term only takes probability away.

    What only a proxy shows is at most as likely as the likeliest that recorded covariates show.
    """
    rest = without(hypotheses.groups, model, cause, sweeps=1)
    gains = hypotheses.gains(rest, hypotheses.named)
    mine = cause.template
    own = max(gains[mine].value, 0.0)
    heat = temperature(own)
    found = {h: gain.term if isinstance(gain.term, Hypothesis) else h for h, gain in gains.items()}
    found[mine] = cause
    log = {h: gain.value / heat for h, gain in gains.items()}
    likeliest, by_proxy = max(log.values()), set()
    for proxy, gain in hypotheses.gains(rest, hypotheses.proxies).items():
        value = gain.value / heat + float(np.log(proxy.odds))
        if value > log.get(proxy.hypothesis, -np.inf):
            log[proxy.hypothesis] = min(value, likeliest)
            by_proxy.add(proxy.hypothesis)
    dear = UNNAMED + DEPARTURE * own
    smooth = [(gain.value - dear) / heat for gain in hypotheses.gains(rest, unnamed(hypotheses, cause)).values()]
    whole = np.logaddexp.reduce([*log.values(), max(smooth, default=-np.inf)])
    probability = {h: float(np.exp(value - whole)) for h, value in log.items()}
    least = CLASS_SHARE * max(probability.values())
    members = [
        Contender(found.get(h, h), p, h not in by_proxy) for h, p in probability.items() if p >= least or h == mine
    ]
    return tuple(sorted(members, key=lambda m: (-m.probability, m.hypothesis.place != cause.place)))


def temperature(evidence: float) -> float:
    """What gains in log evidence are divided by, where so much evidence is at stake."""
    return min(TEMPERATURE + WARMING * evidence, WARMEST)


def unnamed(hypotheses: HypothesisSet, cause: Term) -> list[SmoothTerm]:
    """Smooth terms that are not only a modulation of a cause."""
    return [s for s in hypotheses.smooth if not (isinstance(cause, Hypothesis) and hypotheses.modulates(s, (cause,)))]
