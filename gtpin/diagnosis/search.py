"""Search for the model of largest worth: forward steps from several first explanations, swaps and removals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gtpin.diagnosis.hypothesis import Hypothesis, related, same_place
from gtpin.diagnosis.hypothesis_set import (
    Explanation,
    Gain,
    HypothesisSet,
    Term,
    causes,
    explained_by,
    scales,
)
from gtpin.diagnosis.lines import further_lines, settled, widened, with_all_lines, with_its_lines
from gtpin.diagnosis.posterior import NOTHING, without

BEAM = 3
"""Number of first explanations that are tried: the best single explanation need not be in the best pair."""
MARGIN, MARGIN_SHARE = 30.0, 0.01
"""Largest gain in worth by new scales after an explanation was removed: nats, and as a share of the worth. Assumed."""
MOST = 5
"""Most explanations in a model of a robot with rods; without rods, one more for each actuator."""


def most(hypotheses: HypothesisSet) -> int:
    """Largest number of explanations in a model."""
    return MOST + hypotheses.design.operating_points.robot.n_actuators if hypotheses.long else MOST


def rough_guess(hypotheses: HypothesisSet, before: Explanation = NOTHING) -> Explanation:
    """A model of everything that is not noise, by one search from a single first explanation.

    ``before``: an earlier such model, of these poses with another noise. A search of a robot without rods, whose models are
    long, starts from it.
    """
    alone = hypotheses.gains(NOTHING, hypotheses.every)
    return search(hypotheses, hypotheses.every, alone, beginnings=1, start=_anew(hypotheses, before))


def search(
    hypotheses: HypothesisSet,
    terms: Sequence[Term],
    alone: Mapping[Term, Gain],
    beginnings: int = BEAM,
    largest: int | None = None,
    start: Explanation = NOTHING,
) -> Explanation:
    """The model of largest worth that was found, out of some explanations.

    ``terms``: the explanations that the model can have. ``alone``: gain in log evidence of each as the only one.
    ``beginnings``: number of first explanations that are tried. ``largest``: largest number of explanations in the model; by
    default :func:`most`. ``start``: a model of these hypotheses that is extended first. If it then has more than ``MOST``
    explanations, no other first explanation is tried.
    """
    largest = most(hypotheses) if largest is None else largest
    terms = _with_room(hypotheses, NOTHING, terms)
    order = sorted(terms, key=lambda t: -(alone[t].value - hypotheses.cost(t)))
    best: Explanation = _grow(hypotheses, start, terms, largest) if start.terms else NOTHING
    taken = {hypotheses.without_value(t) for t in best.terms}
    for term in order[: beginnings if len(best.terms) <= MOST else 0]:
        if alone[term].value < hypotheses.cost(term):
            break
        if term in taken:
            continue
        grown = _grown(hypotheses, alone[term].term, terms, largest)
        if hypotheses.log_posterior(grown) > hypotheses.log_posterior(best):
            best = grown
            taken = {hypotheses.without_value(t) for t in best.terms}
    return best


def _grown(hypotheses: HypothesisSet, first: Term, terms: Sequence[Term], largest: int) -> Explanation:
    key = first, tuple(terms), largest
    if key not in hypotheses.grown:
        hypotheses.grown[key] = _grow(hypotheses, hypotheses.extended(NOTHING, first), terms, largest)
    return hypotheses.grown[key]


def _anew(hypotheses: HypothesisSet, before: Explanation) -> Explanation:
    """An earlier model with this noise: its explanations that these hypotheses have, without those that reduce the worth."""
    known = set(hypotheses.every)
    terms = [term for term in before.terms if hypotheses.without_value(term) in known]
    if not hypotheses.long or not terms:
        return NOTHING
    return _pruned(hypotheses, hypotheses.of(terms, [scales(before)[term] for term in terms]))


def _grow(hypotheses: HypothesisSet, model: Explanation, terms: Sequence[Term], largest: int) -> Explanation:
    last: dict[tuple[str, str], float] = {}
    while True:
        lines = further_lines(hypotheses, model, last=last)
        gains = hypotheses.net_gains(model, _with_room(hypotheses, model, terms)) if len(model.terms) < largest else {}
        best = max(gains.values(), key=lambda g: g.whole, default=None)
        # Gains are computed with fixed scales: where the step of larger gain does not increase the worth, the other is tried.
        steps = ["term", "lines"] if lines is None or (best and best.whole >= lines[0]) else ["lines", "term"]
        for step in steps:
            larger = model
            if step == "lines" and lines is not None:
                larger = _pruned(hypotheses, widened(hypotheses, model, *lines[1:]))
            elif step == "term" and best is not None and best.whole >= 0.0:
                larger = with_all_lines(hypotheses, model, best)
                if not hypotheses.long:
                    # The same model, found from other first explanations, then has the same values, and known gains. Of a
                    # long model a term would be removed that a swap makes useful.
                    larger = _revalued(hypotheses, _pruned(hypotheses, larger))
                larger = _pruned(hypotheses, _swapped(hypotheses, larger, terms))
            if hypotheses.log_posterior(larger) > hypotheses.log_posterior(model) + 1e-9:
                break
        else:
            larger = _with_lines_instead(hypotheses, settled(hypotheses, model))
            if not hypotheses.log_posterior(larger) > hypotheses.log_posterior(model) + 1e-9:
                return model
        model = larger


def _with_lines_instead(hypotheses: HypothesisSet, model: Explanation) -> Explanation:
    """The model with all lines of a drive in the place of its smooth deviation, where that increases the worth.

    Where a joint has many lines, its smooth deviation gains more than any single line, and no single line in addition is worth
    its prior odds.
    """
    if not hypotheses.long:
        return model
    present = {cause.place for cause in causes(model)}
    for term in model.terms:
        for lines in hypotheses.scanned:
            if lines.effect.most_values < 2 or lines.place in present or explained_by(term).site != lines.site:
                continue
            rest = without(hypotheses.groups, model, term, sweeps=1)
            gain = hypotheses.gains(rest, (lines,))[lines]
            if gain.value > hypotheses.cost(lines) and isinstance(gain.term, Hypothesis):
                trial = _pruned(hypotheses, with_its_lines(hypotheses, rest, gain.term))
                if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model) + 1e-9:
                    return trial
    return model


def _with_room(hypotheses: HypothesisSet, model: Explanation, terms: Sequence[Term]) -> Sequence[Term]:
    """The terms with which a model of a robot without rods has at most ``most_coefficients`` coefficients per measured number.

    Terms of all links of an arm have hundreds of coefficients, and several such terms explain any data.
    """
    if not hypotheses.long:
        return terms
    room = hypotheses.priors.most_coefficients * hypotheses.design.count - len(model.mean)
    if room <= 0.0:
        return []
    groups = hypotheses.groups
    return [term for term in terms if term not in groups or groups.width(term) <= room]


def _swapped(hypotheses: HypothesisSet, model: Explanation, terms: Sequence[Term]) -> Explanation:
    """The model after exchanges of one explanation for another that increase its worth."""
    for _ in range(3):
        before = model
        for term in model.terms:
            rest = without(hypotheses.groups, model, term, sweeps=1)
            others = _instead(hypotheses, term, _with_room(hypotheses, rest, terms))
            found = hypotheses.gains(rest, (hypotheses.without_value(term), *others))
            gains = {t: gain.value - hypotheses.cost(t) for t, gain in found.items()}
            own, other = hypotheses.without_value(term), max(gains, key=lambda t: gains[t])
            # Further lines of a periodic error are not in the gain of a single one.
            mine = max(gains[own], hypotheses.log_posterior(model) - hypotheses.log_posterior(rest))
            if other != own and gains[other] > mine + 0.5:
                trial = hypotheses.extended(rest, found[other].term)
                if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model):
                    model = trial
                    break
        if model is before:
            return model
    return model


def _revalued(hypotheses: HypothesisSet, model: Explanation) -> Explanation:
    """The model with nonlinear parameters estimated beside the explanations that are left; they were found beside others."""
    for term in model.terms:
        if isinstance(term, Hypothesis) and len(term.values) == 1:
            rest = without(hypotheses.groups, model, term, sweeps=1)
            found = hypotheses.gains(rest, (term.template,))[term.template].term
            if isinstance(found, Hypothesis) and found != term:
                trial = hypotheses.replaced(model, term, found)
                if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model):
                    model = trial
    return model


def _instead(hypotheses: HypothesisSet, term: Term, terms: Sequence[Term]) -> Sequence[Term]:
    """The explanations that are tried in the place of ``term``: for a robot without rods, those that can look like it."""
    robot, own = hypotheses.design.operating_points.robot, explained_by(term)
    if not hypotheses.long:
        return terms
    return [t for t in terms if same_place(robot, own, explained_by(t)) or related(robot, own, explained_by(t))]


def _pruned(hypotheses: HypothesisSet, model: Explanation) -> Explanation:
    """The model without the explanations that reduce its worth."""
    groups = hypotheses.groups
    while model.terms:
        log_posterior = hypotheses.log_posterior(model)
        terms = model.terms
        if hypotheses.long:  # such models are large: new scales are computed only where a removal loses little worth
            margin = max(MARGIN, MARGIN_SHARE * abs(log_posterior))
            terms = tuple(
                t for t in terms if hypotheses.log_posterior(without(groups, model, t)) > log_posterior - margin
            )
        smaller = [without(groups, model, t, sweeps=1) for t in terms]
        best = max(smaller, key=hypotheses.log_posterior, default=model)
        if best is model or hypotheses.log_posterior(best) < log_posterior:
            return model
        model = best
    return model
