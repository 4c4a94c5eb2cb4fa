"""The search for the model of largest log posterior: it adds, exchanges and removes terms while this increases."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from gtpin.diagnosis.evidence import NOTHING, Posterior, without
from gtpin.diagnosis.hypothesis import Hypothesis, Term, explained_by, related, same_place
from gtpin.diagnosis.hypothesis_set import Gain, HypothesisSet, causes, scales, smooth_of
from gtpin.diagnosis.periodic_lines import (
    LINES_CONVERGED,
    further_lines,
    widened,
    with_all_lines,
    with_lines,
    with_lines_reestimated,
)

Passed = dict[frozenset[tuple[Term, tuple[float, ...], float]], Posterior[Term]]
"""Where a search ends, by the models that it passed: their terms, values and scales."""

BEAM = 3
"""Number of first terms that are tried: the best single term need not be in the best pair."""
REMOVAL_MARGIN, REMOVAL_SHARE = 30.0, 0.01
"""Largest gain in log posterior by new scales after a term was removed: nats, and as a share of the log posterior. Assumed."""
MOST_TERMS = 5
"""Most terms in a model of a robot with rods; without rods, one more for each actuator."""


def rough_guess(hypotheses: HypothesisSet, before: Posterior[Term] = NOTHING) -> Posterior[Term]:
    """A model of everything that is not noise, by one search from a single first term.

    ``before``: an earlier such model, of these poses with another noise. A search of a robot without rods, whose models are
    long, starts from it.
    """
    start, known = NOTHING, set(hypotheses.every)
    terms = [term for term in before.terms if hypotheses.without_value(term) in known]
    if hypotheses.long and terms:
        start = _pruned(hypotheses, hypotheses.of(terms, [scales(before)[term] for term in terms]))
    return search(hypotheses, hypotheses.every, beginnings=1, start=start)


def search(
    hypotheses: HypothesisSet,
    terms: Sequence[Term],
    beginnings: int = BEAM,
    start: Posterior[Term] = NOTHING,
) -> Posterior[Term]:
    """The model of largest log posterior that was found, out of some terms.

    ``terms``: the terms that the model can have. ``beginnings``: number of first terms that are tried. ``start``: a model of
    these hypotheses that is extended first; if it then has more than ``MOST_TERMS`` terms, no other first term is tried. At
    last an effect at all actuators is tried, where this explains more than each term alone: actuators of one build have the
    same weakness, and the first step from one of them can lead to a term that imitates all.
    """
    largest = _most_terms(hypotheses)
    alone, terms = hypotheses.gains(NOTHING, terms), _with_room(hypotheses, NOTHING, terms)
    order = sorted(terms, key=lambda t: -(alone[t].value - hypotheses.cost(t)))
    passed: Passed = {}
    best: Posterior[Term] = _extend(hypotheses, start, terms, largest, passed) if start.terms else NOTHING
    taken = {hypotheses.without_value(t) for t in best.terms}
    for term in order[: beginnings if len(best.terms) <= MOST_TERMS else 0]:
        if alone[term].value < hypotheses.cost(term):
            break
        if term in taken:
            continue
        first = (alone[term].term,)
        if (key := (first, tuple(terms), largest)) not in hypotheses.searches:
            hypotheses.searches[key] = _extend(hypotheses, hypotheses.of(first, (1.0,)), terms, largest, passed)
        larger = hypotheses.searches[key]
        if hypotheses.log_posterior(larger) > hypotheses.log_posterior(best):
            best = larger
            taken = {hypotheses.without_value(t) for t in best.terms}
    for alike in _at_all_actuators(hypotheses, terms, alone):
        every = (alike, tuple(terms), largest)
        if every not in hypotheses.searches:
            larger = hypotheses.of(alike, [1.0] * len(alike))
            if hypotheses.log_posterior(larger) > alone[order[0]].value - hypotheses.cost(order[0]):
                larger = _extend(hypotheses, _pruned(hypotheses, larger), terms, largest, passed)
            hypotheses.searches[every] = larger
        best = max(best, hypotheses.searches[every], key=hypotheses.log_posterior)
    tried = set[tuple[Term, ...]]()
    while (two := _two_instead(hypotheses, best, terms)) is not None and two.terms not in tried:
        tried.add(two.terms)
        best = _extend(hypotheses, two, terms, largest, passed)
    return best


LEAST_SHARE = 0.5
"""Smallest gain of the first of two, as a share of the one cause that both replace. Assumed: of two that together explain as
much as one cause, the larger explains at least half of it."""


def _two_instead(hypotheses: HypothesisSet, model: Posterior[Term], terms: Sequence[Term]) -> Posterior[Term] | None:
    """The model with two of one mechanism in the place of a cause, all under load, where these explain more.

    The parts of a machine carry their loads in series: two drives that give way look like links that all bend, and each drive
    alone explains less than these. Where each of the two gains more than twice its cost, neither is a departure of the other
    from its equation, and their penalty does not count against the cause that they replace, which would have to depart from
    its own. None if there is no such model. Study: tests/diagnosis/test_soft_drives.py.
    """
    allowed = [t for t in terms if isinstance(t, Hypothesis) and t.effect.load and t not in model.terms]
    for cause in (c for c in causes(model) if c.effect.load):
        rest = without(hypotheses.groups, model, cause, sweeps=1)
        least = LEAST_SHARE * (model.log_evidence - rest.log_evidence)
        gains = hypotheses.gains(rest, [t for t in allowed if t.effect is not cause.effect])
        firsts = sorted((t for t in gains if gains[t].value >= least), key=lambda t: gains[t].value)
        for first in {t.effect: t for t in firsts}.values():
            both = with_two(hypotheses, rest, first, [t for t in allowed if t.effect is first.effect])
            pair = causes(both)[-2:]
            odds = sum(hypotheses.cost(t) for t in pair) - hypotheses.cost(cause)
            more = len(both.terms) > len(model.terms) and both.log_evidence - odds > model.log_evidence
            if more and all(pays(hypotheses, both, t) for t in pair):
                return both
    return None


def with_two(
    hypotheses: HypothesisSet, model: Posterior[Term], first: Hypothesis, seconds: Iterable[Hypothesis]
) -> Posterior[Term]:
    """The model with a first hypothesis and, at the end, that of some seconds which then gains most less its cost, if any."""
    one = hypotheses.extended(model, first)
    more = hypotheses.net_gains(one, [h for h in seconds if h != first])
    return hypotheses.extended(one, max(more, key=lambda h: more[h].value)) if more else one


def pays(hypotheses: HypothesisSet, model: Posterior[Term], cause: Hypothesis) -> bool:
    """Whether a cause of a model gains more than twice its cost."""
    loss = model.log_evidence - without(hypotheses.groups, model, cause).log_evidence
    return loss > 2.0 * hypotheses.costs(model.terms)[cause]


def with_residuals(hypotheses: HypothesisSet, model: Posterior[Term]) -> Posterior[Term]:
    """A model with smooth terms, or a better one in which mechanisms come before further smooth terms.

    A smooth term is what mechanisms leave. A second one takes what a mechanism explains beside another first one, and by
    exchanges of one term the search does not return. So each of the ``BEAM`` smooth terms that gain most beside the causes is
    the only one in turn: mechanisms are added first, then any terms. Study: examples/planted (Stewart platform).
    """
    if not smooth_of(model):
        return model
    largest, known = _most_terms(hypotheses), hypotheses.only(model, causes(model))
    mechanisms = [h for h in hypotheses.linear if h.effect.nature == "mechanism"]
    gains = hypotheses.gains(known, hypotheses.smooth)
    first: Passed = {}
    then: Passed = {}
    for term in sorted(gains, key=lambda term: -gains[term].value)[:BEAM]:
        beside = _extend(hypotheses, hypotheses.extended(known, term), mechanisms, largest, first)
        beside = _extend(hypotheses, beside, hypotheses.every, largest, then)
        model = max(model, beside, key=hypotheses.log_posterior)
    return model


def _most_terms(hypotheses: HypothesisSet) -> int:
    return MOST_TERMS + hypotheses.design.operating_points.robot.n_actuators if hypotheses.long else MOST_TERMS


def _at_all_actuators(
    hypotheses: HypothesisSet, terms: Sequence[Term], alone: Mapping[Term, Gain]
) -> Iterator[tuple[Term, ...]]:
    """By effect, the hypotheses at actuators that each could be the only term, where there are several.

    Not of robots without rods, whose models are long.
    """
    known, sites = set(terms), hypotheses.design.operating_points.robot.sites
    found: dict[str, list[Hypothesis]] = {}
    for term in () if hypotheses.long else hypotheses.linear:
        if term in known and term.site in sites and alone[term].value > hypotheses.cost(term):
            found.setdefault(term.effect.id, []).append(term)
    yield from (tuple(alike) for alike in found.values() if len(alike) > 1)


def _extend(
    hypotheses: HypothesisSet,
    model: Posterior[Term],
    terms: Sequence[Term],
    largest: int,
    passed: Passed,
) -> Posterior[Term]:
    """A model after all steps that increase its log posterior: one more term, more lines of a term, exchanges, removals.

    ``passed``: what became of the models that searches of these terms have passed, by their terms in any order, values (to
    1e-9 of their units) and scales: from one of them on, the steps are the same.
    """
    last: dict[tuple[str, str], float] = {}
    net: dict[Term, float] = {}
    known: set[frozenset[tuple[Term, int]]] = set()
    way = []
    while True:
        values = [tuple(np.round(t.values, 9)) if isinstance(t, Hypothesis) else () for t in model.terms]
        way.append(frozenset(zip(map(hypotheses.without_value, model.terms), values, model.scale, strict=True)))
        if way[-1] in passed:
            model = passed[way[-1]]
            break
        # Where nothing gained, small changes of the lines make nothing gain.
        shape = frozenset((hypotheses.without_value(t), len(v)) for t, v in zip(model.terms, values, strict=True))
        every = shape not in known
        lines = further_lines(hypotheses, model, last=last, every=every)
        best = _best(hypotheses, model, terms, net, every) if len(model.terms) < largest else None
        if every and lines is None and (best is None or best.whole < 0.0):
            known.add(shape)
        # Gains are computed with fixed scales: where the step of larger gain does not increase the log posterior, the other is
        # tried.
        steps = ["term", "lines"] if lines is None or (best and best.whole >= lines[0]) else ["lines", "term"]
        for step in steps:
            larger = model
            if step == "lines" and lines is not None:
                larger = _pruned(hypotheses, widened(hypotheses, model, *lines[1:]))
            elif step == "term" and best is not None and best.whole >= 0.0:
                larger = with_all_lines(hypotheses, model, best)
                if not hypotheses.long:  # of a long model a term would be removed that a swap makes useful
                    larger = _pruned(hypotheses, larger)
                larger = _pruned(hypotheses, _swapped(hypotheses, larger, terms))
            if hypotheses.log_posterior(larger) > hypotheses.log_posterior(model) + 1e-9:
                break
        else:
            larger = with_lines_reestimated(hypotheses, model)
            if hypotheses.log_posterior(larger) < hypotheses.log_posterior(model) + LINES_CONVERGED:
                larger = _with_lines_instead(hypotheses, larger)  # the most costly step comes last
            if hypotheses.log_posterior(larger) < hypotheses.log_posterior(model) + LINES_CONVERGED:
                model = larger
                break
        model = larger
    passed |= dict.fromkeys(way, model)
    return model


def _best(
    hypotheses: HypothesisSet, model: Posterior[Term], terms: Sequence[Term], net: dict[Term, float], every: bool
) -> Gain | None:
    """The largest gain in log posterior by one more term that fits into a model; None where no term fits.

    ``net``: gains of the terms beside an earlier, smaller model; they are updated here. A term seldom gains more in a larger
    model, so those that gained less than the best one now are computed again only where none gains, and ``every`` is true.
    """
    left = sorted(_with_room(hypotheses, model, terms), key=lambda t: -net.get(t, np.inf))
    best: Gain | None = None
    while left:
        least = max(best.whole if best else 0.0, 0.0)
        if net.get(left[0], np.inf) > least:
            count = max(sum(t not in net for t in left), 1)
        elif every and (best is None or best.whole < 0.0):
            count = len(left)
        else:
            break
        found = hypotheses.net_gains(model, left[:count])
        net |= {term: gain.whole for term, gain in found.items()}
        best = max([*([best] if best else []), *found.values()], key=lambda g: g.whole, default=None)
        left = left[count:]
    return best


def _with_lines_instead(hypotheses: HypothesisSet, model: Posterior[Term]) -> Posterior[Term]:
    """The model with all lines of a drive in the place of its smooth deviation, where that increases the log posterior.

    Where a joint has many lines, its smooth deviation gains more than any single line, and no single line in addition gains
    more than its prior odds.
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
                trial = _pruned(hypotheses, with_lines(hypotheses, rest, gain.term))
                if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model) + 1e-9:
                    return trial
    return model


def _with_room(hypotheses: HypothesisSet, model: Posterior[Term], terms: Sequence[Term]) -> Sequence[Term]:
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


def _swapped(hypotheses: HypothesisSet, model: Posterior[Term], terms: Sequence[Term]) -> Posterior[Term]:
    """The model after exchanges of one term for another that increase its log posterior."""
    for _ in range(3):
        before = model
        for term in model.terms:
            rest = without(hypotheses.groups, model, term, sweeps=1)
            others = _with_room(hypotheses, rest, terms)
            if hypotheses.long:  # of many terms, only those that can look like this one
                robot, mine = hypotheses.design.operating_points.robot, explained_by(term)
                others = [
                    t
                    for t in others
                    if same_place(robot, mine, explained_by(t)) or related(robot, mine, explained_by(t))
                ]
            found = hypotheses.gains(rest, (hypotheses.without_value(term), *others))
            gains = {t: gain.value - hypotheses.cost(t) for t, gain in found.items()}
            own, other = hypotheses.without_value(term), max(gains, key=lambda t: gains[t])
            # Further lines of a periodic error are not in the gain of a single one.
            least = max(gains[own], hypotheses.log_posterior(model) - hypotheses.log_posterior(rest)) + 0.5
            if other != own and gains[other] > least:
                trial = hypotheses.extended(rest, found[other].term)
                if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model):
                    model = trial
                    break
        if model is before:
            return model
    return model


def _pruned(hypotheses: HypothesisSet, model: Posterior[Term]) -> Posterior[Term]:
    """The model without the terms that reduce its log posterior."""
    groups = hypotheses.groups
    while model.terms:
        log_posterior = hypotheses.log_posterior(model)
        terms = model.terms
        if hypotheses.long:  # such models are large: new scales are computed only where a removal loses little
            margin = max(REMOVAL_MARGIN, REMOVAL_SHARE * abs(log_posterior))
            terms = tuple(
                t for t in terms if hypotheses.log_posterior(without(groups, model, t)) > log_posterior - margin
            )
        smaller = [without(groups, model, t, sweeps=1) for t in terms]
        best = max(smaller, key=hypotheses.log_posterior, default=model)
        if best is model or hypotheses.log_posterior(best) < log_posterior:
            return model
        model = best
    return model
