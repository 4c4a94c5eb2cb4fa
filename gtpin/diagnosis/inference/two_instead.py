"""Two causes that together could be in the place of one: two thermal effects in the place of a drift of the instrument, say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from math import exp

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import Gain, HypothesisSet, Model, causes
from gtpin.diagnosis.inference.classes import temperature
from gtpin.diagnosis.inference.search import most
from gtpin.diagnosis.inference.verdict import Contender
from gtpin.diagnosis.linear.exchange import without
from gtpin.diagnosis.priors import CLASS_SHARE

Classes = Mapping[Hypothesis, tuple[Contender, ...]]
FIRSTS = 4
"""Number of hypotheses that are tried as the first of the two. Assumed: the computing time is proportional to it."""
LEAST_SHARE = 0.5
"""Smallest gain of the first of the two, as a share of the cause's own. Assumed: of two that together explain as much as one
cause, the larger explains at least half of it."""


def exchanged_for_two(hypotheses: HypothesisSet, model: Model) -> Model:
    """The model with two hypotheses in the place of one of its causes, where that increases the worth.

    A search that adds one explanation at a time can end with one cause where two are true.
    """
    if not hypotheses.design.situation.robot.rods or len(model.terms) >= most(hypotheses):
        return model
    for cause in causes(model):
        rest = without(hypotheses.groups, model, cause, sweeps=1)
        found = _best(hypotheses, rest, (cause,), LEAST_SHARE * (model.log_evidence - rest.log_evidence))
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
    found = _best(hypotheses, rest, (cause,), LEAST_SHARE * own)
    if found is None:
        return members
    two, firsts = found
    odds = _odds(hypotheses, two, model, own)
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


def with_two_exchanged(hypotheses: HypothesisSet, model: Model, classes: Classes) -> Classes:
    """The classes with two other hypotheses in the place of two causes at once, where they are probable enough.

    Each of the two is added to the class of the cause whose place it takes, with the probability of both. Classes in which one
    cause is exchanged at a time do not show that two causes together can be two others.
    """
    if not hypotheses.design.situation.robot.rods:
        return classes
    found = dict(classes)
    for pair in combinations(causes(model), 2):
        rest = without(hypotheses.groups, without(hypotheses.groups, model, pair[0]), pair[1], sweeps=1)
        own = model.log_evidence - rest.log_evidence
        best = _best(hypotheses, rest, pair, LEAST_SHARE * own / 2.0)
        if best is None:
            continue
        odds = _odds(hypotheses, best[0], model, own)
        for cause, other in zip(pair, best[1], strict=True):
            found[cause] = _joined(found[cause], cause, other, odds)
    return found


def _joined(members: tuple[Contender, ...], cause: Hypothesis, other: Hypothesis, odds: float) -> tuple[Contender, ...]:
    """A class with ``other`` added, whose odds over the cause are ``odds``; unchanged where these are too small."""
    leader = next(m.probability for m in members if m.hypothesis.place == cause.place)
    if odds < CLASS_SHARE or any(m.hypothesis.place == other.place for m in members):
        return members
    whole = 1.0 + odds * leader
    kept = [replace(m, probability=m.probability / whole) for m in members]
    kept.append(Contender(other, odds * leader / whole))
    return tuple(sorted(kept, key=lambda m: (-m.probability, m.hypothesis.place != cause.place)))


def _odds(hypotheses: HypothesisSet, other: Model, model: Model, own: float) -> float:
    """Odds, at most 1, of ``other`` over ``model``. ``own``: gain, nats, in ``model`` of the causes that ``other`` replaces."""
    ahead = hypotheses.worth(other) - hypotheses.worth(model)
    return exp(min(ahead / temperature(max(own, 0.0), hypotheses.priors), 0.0))


def _best(
    hypotheses: HypothesisSet, rest: Model, out: Sequence[Hypothesis], least: float
) -> tuple[Model, tuple[Hypothesis, Hypothesis]] | None:
    """The model of largest worth with two hypotheses beside ``rest``, and these two.

    Neither is one of ``out``, and the first gains at least ``least``, nats.
    """
    scanned, places = set(hypotheses.scanned), {h.place for h in out}
    plain = [h for h in hypotheses.named if h not in scanned and h.place not in places]
    gains = hypotheses.gains(rest, plain)
    firsts = sorted((h for h in gains if gains[h].value >= least), key=lambda h: -gains[h].value)[:FIRSTS]
    found: list[tuple[Model, tuple[Hypothesis, Hypothesis]]] = []
    for first in firsts:
        one = hypotheses.extended(rest, first)
        more: dict[Hypothesis, Gain] = hypotheses.net_gains(one, [h for h in plain if h != first])
        if more:
            second = max(more, key=lambda h: more[h].value)
            found.append((hypotheses.extended(one, second), (first, second)))
    return max(found, key=lambda pair: hypotheses.worth(pair[0]), default=None)
