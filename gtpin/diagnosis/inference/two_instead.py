"""Two causes that together could be in the place of one: a drift of the instrument and two thermal effects, say."""

from __future__ import annotations

from dataclasses import replace
from math import exp

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import Gain, HypothesisSet, Model, causes
from gtpin.diagnosis.inference.classes import temperature
from gtpin.diagnosis.inference.search import most
from gtpin.diagnosis.inference.verdict import Contender
from gtpin.diagnosis.linear.exchange import without
from gtpin.diagnosis.priors import CLASS_SHARE

FIRSTS = 4
"""Hypotheses that are tried as the first of the two. Assumed: the search has its time from as few."""
LEAST_SHARE = 0.5
"""Least gain of the first of the two, as a share of the cause's own. Assumed: of two that explain as much as one cause, the
larger explains half of it."""


def exchanged_for_two(hypotheses: HypothesisSet, model: Model) -> Model:
    """The model with two hypotheses in the place of one of its causes, where that increases the worth.

    A search that adds one explanation at a time can stop at the one that takes the place of two.
    """
    if not hypotheses.design.situation.robot.rods or len(model.terms) >= most(hypotheses):
        return model
    for cause in causes(model):
        rest = without(hypotheses.groups, model, cause, sweeps=1)
        found = _best(hypotheses, rest, cause, model.log_evidence - rest.log_evidence)
        if found is not None and hypotheses.worth(found[0]) > hypotheses.worth(model) + 1e-9:
            return exchanged_for_two(hypotheses, found[0])
    return model


def with_two_instead(
    hypotheses: HypothesisSet, model: Model, cause: Hypothesis, members: tuple[Contender, ...]
) -> tuple[Contender, ...]:
    """The class of a cause with the two hypotheses that could together be in its place, where they are probable enough.

    Each of the two has half of the probability of both, so that the probabilities of a class sum to at most 1.

    Parameters
    ----------
    model
        A model that has the cause.
    members
        The class of the cause: one hypothesis at a time in its place.
    """
    if not hypotheses.design.situation.robot.rods:
        return members
    rest = without(hypotheses.groups, model, cause, sweeps=1)
    own = model.log_evidence - rest.log_evidence
    found = _best(hypotheses, rest, cause, own)
    if found is None:
        return members
    two, firsts = found
    odds = exp(
        min((hypotheses.worth(two) - hypotheses.worth(model)) / temperature(max(own, 0.0), hypotheses.priors), 0.0)
    )
    leader = next(m.probability for m in members if m.hypothesis.place == cause.place)
    whole = 1.0 + odds * leader
    each = odds * leader / whole / 2.0
    if 2.0 * each < CLASS_SHARE * max(m.probability for m in members) / whole:
        return members
    known = {m.hypothesis.place: replace(m, probability=m.probability / whole) for m in members}
    for hypothesis, other in (firsts, firsts[::-1]):
        alone = known.get(hypothesis.place, Contender(hypothesis, 0.0, beside=other))
        known[hypothesis.place] = replace(alone, probability=alone.probability + each)
    return tuple(sorted(known.values(), key=lambda m: (-m.probability, m.hypothesis.place != cause.place)))


def _best(
    hypotheses: HypothesisSet, rest: Model, cause: Hypothesis, own: float
) -> tuple[Model, tuple[Hypothesis, Hypothesis]] | None:
    """The model of largest worth with two hypotheses beside ``rest``, neither of them the cause, and these two."""
    scanned = set(hypotheses.scanned)
    plain = [h for h in hypotheses.named if h not in scanned and h.place != cause.place]
    gains = hypotheses.gains(rest, plain)
    firsts = sorted((h for h in gains if gains[h].value >= LEAST_SHARE * own), key=lambda h: -gains[h].value)[:FIRSTS]
    found: list[tuple[Model, tuple[Hypothesis, Hypothesis]]] = []
    for first in firsts:
        one = hypotheses.extended(rest, first)
        more: dict[Hypothesis, Gain] = hypotheses.net_gains(one, [h for h in plain if h != first])
        if more:
            second = max(more, key=lambda h: more[h].value)
            found.append((hypotheses.extended(one, second), (first, second)))
    return max(found, key=lambda pair: hypotheses.worth(pair[0]), default=None)
