"""The class of a cause: every hypothesis that could be the cause in its place, with its probability."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis, SmoothTerm
from gtpin.diagnosis.hypotheses.hypothesis_set import Gain, HypothesisSet, Model, Term
from gtpin.diagnosis.hypotheses.lines import with_its_lines
from gtpin.diagnosis.inference.verdict import Contender
from gtpin.diagnosis.linear.exchange import without
from gtpin.diagnosis.priors import CLASS_SHARE, Priors


def contenders(hypotheses: HypothesisSet, model: Model, cause: Hypothesis) -> tuple[Contender, ...]:
    """The class of a cause, the most probable member first. Smooth terms share the probability but are not members."""
    found = ranked(hypotheses, model, cause).named
    least = CLASS_SHARE * found[0].probability
    return tuple(m for m in found if m.probability >= least or m.hypothesis.place == cause.place)


@dataclass(frozen=True)
class Ranking:
    """Everything that could be in the place of a cause, the most probable first.

    Parameters
    ----------
    named
        Every hypothesis with its probability.
    smooth
        Smooth terms with the probability of each if it were the only one.
    heat
        The temperature by which gains in log evidence were divided.
    """

    named: tuple[Contender, ...]
    smooth: tuple[tuple[SmoothTerm, float], ...]
    heat: float


def ranked(hypotheses: HypothesisSet, model: Model, cause: Hypothesis) -> Ranking:
    """Everything that could be in the place of a cause, with its probability.

    A hypothesis that only a proxy shows is at most as probable as the most probable one that recorded covariates show.
    """
    rest = without(hypotheses.groups, model, cause, sweeps=1)
    gains = hypotheses.gains(rest, hypotheses.named)
    mine = cause.template
    priors = hypotheses.priors
    lined = _with_lines(hypotheses, rest, gains, cause)
    if cause.further or lined:  # all its lines together; if others have lines, with all scales estimated, as for those
        gained = model.log_evidence - rest.log_evidence - priors.line * len(cause.further)
        gains[mine] = Gain(max(gains[mine].value, gained), cause)
    gains |= lined
    own = max(gains[mine].value, 0.0)
    heat = temperature(own, priors)
    found = {h: gain.term if isinstance(gain.term, Hypothesis) else h for h, gain in gains.items()}
    found[mine] = cause
    odds = _odds(hypotheses, rest, gains, mine)
    log = {h: (gain.value - odds[h]) / heat for h, gain in gains.items()}
    likeliest, by_proxy = max(log.values()), set()
    for proxy, gain in hypotheses.gains(rest, hypotheses.proxies).items():
        value = gain.value / heat + float(np.log(proxy.odds))
        if value > log.get(proxy.hypothesis, -np.inf):
            log[proxy.hypothesis] = min(value, likeliest)
            by_proxy.add(proxy.hypothesis)
    against = hypotheses.gains(rest, unnamed(hypotheses, cause))
    # Several lines can follow any smooth function, so nothing is added for a departure of the cause from its equation.
    dear = {s: priors.unnamed + (0.0 if hypotheses.modulates(s, (cause,)) else priors.departure * own) for s in against}
    smooth = {s: (gain.value - dear[s]) / heat for s, gain in against.items()}
    whole = np.logaddexp.reduce([*log.values(), max(smooth.values(), default=-np.inf)])
    probability = {h: float(np.exp(value - whole)) for h, value in log.items()}
    every = [Contender(found.get(h, h), p, h not in by_proxy) for h, p in probability.items()]
    named = tuple(sorted(every, key=lambda m: (-m.probability, m.hypothesis.place != cause.place)))
    shares = ((term, float(np.exp(value - whole))) for term, value in smooth.items())
    return Ranking(named, tuple(sorted(shares, key=lambda share: -share[1])), heat)


def _odds(
    hypotheses: HypothesisSet, rest: Model, others: Iterable[Hypothesis], cause: Hypothesis
) -> dict[Hypothesis, float]:
    """Log prior odds, nats, against the model ``rest`` with each hypothesis, less those against ``rest`` with ``cause``.

    They differ because a hypothesis at the site of a stronger cause may be that cause's departure from its equation.
    """
    whole = {h: sum(hypotheses.costs((*rest.terms, h)).values()) for h in (*others, cause)}
    return {h: value - whole[cause] for h, value in whole.items()}


def _with_lines(
    hypotheses: HypothesisSet, rest: Model, gains: Mapping[Hypothesis, Gain], cause: Hypothesis
) -> dict[Hypothesis, Gain]:
    """Gains, with all their lines, of the other periodic errors at a cause's site whose first line exceeds its prior odds."""
    found: dict[Hypothesis, Gain] = {}
    if hypotheses.design.situation.robot.rods:
        return found
    for hypothesis, gain in gains.items():
        if hypothesis.effect.most_values < 2 or hypothesis.site != cause.site or hypothesis == cause.template:
            continue
        if gain.value > hypotheses.cost(hypothesis) and isinstance(gain.term, Hypothesis):
            lined = with_its_lines(hypotheses, rest, gain.term)
            term = next(t for t in lined.terms if isinstance(t, Hypothesis) and t.place == hypothesis.place)
            value = lined.log_evidence - rest.log_evidence - hypotheses.priors.line * len(term.further)
            found[hypothesis] = Gain(max(value, gain.value), term)
    return found


def temperature(evidence: float, priors: Priors) -> float:
    """The temperature by which gains in log evidence are divided, for a cause that gains ``evidence``, nats."""
    return min(priors.temperature + priors.warming * evidence, priors.warmest)


def unnamed(hypotheses: HypothesisSet, cause: Term) -> list[SmoothTerm]:
    """Smooth terms that compete with a cause: those that are not only a modulation of it.

    For a cause with several lines, which can follow any smooth function: also not those that are only a modulation of another
    effect at the same drive, because that effect competes itself.
    """
    if not isinstance(cause, Hypothesis):
        return list(hypotheses.smooth)
    known: tuple[Hypothesis, ...] = (cause,)
    if cause.further:
        known = tuple(h for h in hypotheses.linear if h.site == cause.site)
    return [s for s in hypotheses.smooth if not hypotheses.modulates(s, known)]
