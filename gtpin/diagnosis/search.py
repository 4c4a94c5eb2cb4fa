"""Prior odds of the terms, and the search for the model of largest log posterior.

The log posterior of a model m, but for a constant, is its log evidence less the cost of each of its terms:

    ln Lambda(m) - sum of kappa_k over the terms k of m,

with kappa_k of :meth:`HypothesisSet.costs`. The search adds, exchanges and removes terms while this increases.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import (
    NOTHING,
    Groups,
    Marginal,
    Posterior,
    all_gains,
    exchanged,
    fixed,
    tuned,
    without,
    without_coefficients,
)
from gtpin.diagnosis.hypothesis import (
    Hypothesis,
    Proxy,
    Scope,
    SmoothTerm,
    Term,
    explained_by,
    modulates,
    related,
    same_place,
)
from gtpin.diagnosis.scan import NO_GAIN, FittedLines, Scan
from gtpin.diagnosis.smooth_terms import smooth_terms
from gtpin.effects.displacement import Displacement
from gtpin.effects.untestable import Untestable
from gtpin.typing import Floats

T = TypeVar("T", bound=Term)
Passed = dict[frozenset[tuple[Term, tuple[float, ...], float]], Posterior[Term]]
"""Where a search ends, by the models that it passed: their terms, values and scales."""


class Gain(NamedTuple):
    """Gain by one more term.

    ``value``: gain in log evidence, nats. ``term``: the term, with its nonlinear parameter estimated. ``further``: for a
    periodic error that can have several lines: the other lines (period, sigma) that gain enough to be added with the first.
    ``more``: additional gain by these lines less the prior odds against them, nats.
    """

    value: float
    term: Term
    further: tuple[tuple[float, float], ...] = ()
    more: float = 0.0

    @property
    def whole(self) -> float:
        """Gain with all lines."""
        return self.value + self.more


class Untested(NamedTuple):
    """A hypothesis that these data can't test, and why."""

    hypothesis: Hypothesis
    reason: Untestable


class HypothesisSet:
    """Terms, and the inner products of their displacements.

    A hypothesis with another value of its nonlinear parameter is another hypothesis. So a model that a search rejects does
    not change the models that it keeps.

    ``linear``: hypotheses without a nonlinear parameter. ``scanned``: hypotheses whose
    nonlinear parameter is scanned, without a value of it. ``smooth``: smooth terms with their displacements. ``scope``: gives
    the probability of a false alarm, and the priors. ``untested``: effects that can't be tested: those that lack a covariate
    may have a proxy. ``of_sessions``: additional log prior odds against terms that depend on the session, nats.
    ``proxies``: computes the proxies of effects that lack a covariate, when they are first needed.

    ``threshold``: log prior odds against a first named cause, nats: ln(number of hypotheses / ``scope.false_alarm``).
    """

    def __init__(
        self,
        design: Design,
        linear: Sequence[Hypothesis],
        scanned: Sequence[Hypothesis],
        smooth: Iterable[tuple[SmoothTerm, Displacement]],
        scope: Scope,
        untested: Sequence[Untested] = (),
        *,
        of_sessions: float = 0.0,
        proxies: Callable[[], Iterable[Proxy]] = tuple,
    ) -> None:
        self.design, self.linear, self.scanned = design, tuple(linear), tuple(scanned)
        self.untested, self.priors = tuple(untested), scope.priors
        self.groups: Groups[Term] = Groups(Marginal(design.B), design.y, scope.priors)
        for hypothesis in self.linear:
            self._add(hypothesis)
        found = []
        for term, basis in smooth:
            found.append(term)
            self.groups.add(term, design.columns(basis))
        self.smooth = tuple(found)
        self.threshold = float(np.log(max(len(self.named), 1)) + np.log(1.0 / scope.false_alarm))
        self.of_sessions, self._proxies = of_sessions, proxies
        self._scans: dict[Hypothesis, Scan] = {}
        self.models_with_lines: dict[tuple[tuple[Term, ...], tuple[float, ...], Hypothesis], Posterior[Term]] = {}
        """Models with all lines of a periodic error, by terms and scales of the model without the error, and its first line."""
        self.searches: dict[tuple[tuple[Term, ...], tuple[Term, ...], int], Posterior[Term]] = {}
        """Models of earlier searches: by first terms, allowed terms, and number of terms."""
        self._gains: dict[tuple[tuple[Term, ...], tuple[float, ...]], dict[Term, Gain]] = {}
        self._costs: dict[tuple[Term, ...], tuple[float, ...]] = {}

    @property
    def long(self) -> bool:
        """Whether models can be long, as for robots without rods: joints have many lines, and all links many coefficients."""
        return bool(self.design.operating_points.robot.joint_sites)

    @property
    def named(self) -> tuple[Hypothesis, ...]:
        """All effects at their sites; those with a nonlinear parameter without a value of it."""
        return (*self.linear, *self.scanned)

    @property
    def every(self) -> tuple[Term, ...]:
        """All terms that a model can have."""
        return (*self.named, *self.smooth)

    @cached_property
    def proxies(self) -> tuple[Proxy, ...]:
        """Effects with a proxy of a covariate that was not recorded; never in a model, only alternatives to its causes."""
        found = tuple(self._proxies())
        for proxy in found:
            self.groups.add(proxy, proxy.columns)
        return found

    def at_threshold(self, threshold: float) -> HypothesisSet:
        """The same terms, with other log prior odds, nats, against a first named cause."""
        other = copy(self)
        other.threshold, other.models_with_lines, other.searches, other._costs = threshold, {}, {}, {}
        return other

    def barring(self, places: Collection[tuple[str, str]]) -> HypothesisSet:
        """The same terms without the hypotheses at some places (effect, site)."""
        fewer = copy(self)
        # Computed before it is filtered: both sets share the groups, to which the proxies are added once.
        fewer.proxies = tuple(proxy for proxy in self.proxies if proxy.hypothesis.place not in places)
        fewer.linear = tuple(hypothesis for hypothesis in self.linear if hypothesis.place not in places)
        fewer.scanned = tuple(hypothesis for hypothesis in self.scanned if hypothesis.place not in places)
        return fewer

    def _add(self, hypothesis: Hypothesis) -> None:
        if not hypothesis.further:
            basis = hypothesis.basis(self.design.operating_points)
            self.groups.add(hypothesis, self.design.columns(basis), hypothesis.effect.core)
            return
        lines = [Hypothesis(hypothesis.effect, hypothesis.site, value) for value in hypothesis.values]
        for line in lines:
            if line not in self.groups:
                self._add(line)
        self.groups.join(hypothesis, lines)

    def cost(self, term: Term) -> float:
        """Log prior odds against a term as the only one, nats: its gain in log evidence must exceed them.

        ln(n / alpha) for n named hypotheses and the false alarm rate alpha; ``unnamed`` more for smooth terms, ``same_clock``
        for effects of the platform over time or session alone, and, for effects of merged sessions, the logarithm of the number
        of ways to merge them.
        """
        unnamed = self.priors.unnamed if isinstance(term, SmoothTerm) else 0.0
        robot, one = self.design.operating_points.robot, explained_by(term)
        carried = isinstance(one, Hypothesis) and one.site == "platform" and one.clock(robot) is not None
        moved = self.priors.same_clock if carried else 0.0
        return self.threshold + unnamed + moved + (self.of_sessions if "session" in one.drivers(robot) else 0.0)

    def share(self, term: Term, stronger: Term) -> float:
        """Share of a stronger term's evidence that is the penalty of ``term`` beside it.

        The parts of a chain carry their loads in series, and all give way: no imitation is suspected where one does beside
        another. With the share of ``related``, an arm's column and the bearing on it were named as a base that rocks.
        """
        robot, a, b = self.design.operating_points.robot, explained_by(term), explained_by(stronger)
        if robot.joint_sites and all(isinstance(one, Hypothesis) and one.effect.load for one in (a, b)):
            return self.priors.other
        if a.site == b.site and a.drivers(robot) & b.drivers(robot):
            return self.priors.same
        return self.priors.related if related(robot, a, b) else self.priors.other

    def costs(self, terms: Sequence[Term]) -> dict[Term, float]:
        """Cost of each term of a model, nats: what its gain in log evidence must exceed.

            kappa_k = cost of k alone + max over stronger j of (share(k, j) a(j)) + [third or later] third + line (lines - 1)

        with a(j) the gain of j as the only term. All but the second are log prior odds. The second is a penalty by the data's
        own evidence: no machine follows an equation exactly, and a false second term could gain what the stronger one leaves.
        On a robot with rods, the effect of a stronger term at another actuator is no further cause: ``third`` does not apply.
        """
        templates = tuple(self.without_value(term) for term in terms)
        if templates not in self._costs:
            alone, found = {term: self.alone(term) for term in templates}, []
            for term in templates:
                stronger = [self.share(term, t) * alone[t] for t in templates if alone[t] > alone[term]]
                third = self.priors.third if len(stronger) > 1 and not self._again(term, templates, alone) else 0.0
                found.append(self.cost(term) + max(stronger, default=0.0) + third)
            self._costs[templates] = tuple(found)
        lines = (len(term.further) if isinstance(term, Hypothesis) else 0 for term in terms)
        return {
            term: cost + self.priors.line * more
            for term, cost, more in zip(terms, self._costs[templates], lines, strict=True)
        }

    def _again(self, term: Term, terms: Sequence[Term], alone: Mapping[Term, float]) -> bool:
        """Whether a term is a stronger one's effect at another actuator of a robot with rods, whose drives have one build."""
        sites = self.design.operating_points.robot.sites
        if self.long or not isinstance(term, Hypothesis) or term.site not in sites:
            return False
        stronger = (t for t in terms if isinstance(t, Hypothesis) and alone[t] > alone[term])
        return any(t.effect is term.effect and t.site in sites for t in stronger)

    def alone(self, term: Term) -> float:
        """Gain in log evidence of a term as the only one, with the best value of its nonlinear parameter."""
        open_ = self.without_value(term)
        return self.gains(NOTHING, (open_,))[open_].value

    def log_posterior(self, model: Posterior[Term]) -> float:
        """Log posterior of a model, nats, but for a constant: its log evidence less the costs of its terms."""
        return model.log_evidence - sum(self.costs(model.terms).values())

    def net_gains(self, model: Posterior[Term], terms: Iterable[T]) -> dict[T, Gain]:
        """Gain in log posterior, nats, by adding each term to a model whose scales are not changed."""
        before = sum(self.costs(model.terms).values())
        return {
            term: gain._replace(value=gain.value - sum(self.costs((*model.terms, gain.term)).values()) + before)
            for term, gain in self.gains(model, terms).items()
        }

    def gains(self, model: Posterior[Term], terms: Iterable[T]) -> dict[T, Gain]:
        """Gain in log evidence by adding each term to a model, with its nonlinear parameter estimated given the model.

        The scales of the model are not changed. Terms that the model already has, with any value of the nonlinear
        parameter, are left out.
        """
        known = self._gains.setdefault((model.terms, model.scale), {})
        taken = {self.without_value(term) for term in model.terms}
        wanted = [term for term in terms if self.without_value(term) not in taken]
        if new := [term for term in wanted if term not in known]:
            scanned = set(self.scanned)
            plain = all_gains(self.groups, model, (t for t in new if t not in scanned))
            known |= {term: Gain(value, term) for term, (value, _) in plain.items()}
            known |= {t: self.scanned_gain(t, model) for t in new if isinstance(t, Hypothesis) and t in scanned}
        return {term: known[term] for term in wanted}

    def without_value(self, term: Term) -> Term:
        """A hypothesis without the value of its nonlinear parameter; other terms unchanged."""
        return term.template if isinstance(term, Hypothesis) else term

    def scan(self, hypothesis: Hypothesis) -> Scan:
        """The scan of a hypothesis of ``scanned``, prepared once."""
        if hypothesis not in self._scans:
            self._scans[hypothesis] = Scan(self.design, self.groups, hypothesis.effect, hypothesis.site, self.priors)
        return self._scans[hypothesis]

    def scanned_gain(self, hypothesis: Hypothesis, model: Posterior[Term], others: Sequence[float] = ()) -> Gain:
        """Gain by the best value of a hypothesis of ``scanned``; ``others``: its values that the model already has."""
        best = self.scan(hypothesis).best(model, others)
        term = Hypothesis(hypothesis.effect, hypothesis.site, best.value, best.sigma)
        room = hypothesis.effect.most_values - 1 - len(others)
        if not self.long or room < 1:
            return Gain(best.gain, term)
        gaining = [line for line in best.others if line[2] > self.priors.line][:room]
        more = sum(gain - self.priors.line for _, _, gain in gaining)
        return Gain(best.gain, term, tuple((value, sigma) for value, sigma, _ in gaining), more)

    def replaced(self, model: Posterior[Term], old: Hypothesis, new: Hypothesis) -> Posterior[Term]:
        """The model with one hypothesis in the place of another, at the same scales."""
        if new not in self.groups:
            self._add(new)
        return exchanged(self.groups, model, old, new)

    def extended(self, model: Posterior[Term], term: Term) -> Posterior[Term]:
        """A model with one more term, all scales estimated again."""
        return self.of((*model.terms, term), (*model.scale, 1.0))

    def of(self, terms: Sequence[Term], scale: Sequence[float]) -> Posterior[Term]:
        """A model of some terms, its scales estimated from given ones."""
        for term in terms:
            if isinstance(term, Hypothesis) and term not in self.groups:
                self._add(term)
        return tuned(self.groups, terms, scale)

    def modulates(self, smooth: SmoothTerm, model: Posterior[Term] | Collection[Hypothesis]) -> bool:
        """Whether a smooth term is only a modulation of one of some hypotheses."""
        terms = model.terms if isinstance(model, Posterior) else model
        at = self.design.operating_points
        return any(isinstance(term, Hypothesis) and modulates(at, smooth, term) for term in terms)

    def columns(self, model: Posterior[Term]) -> Floats:
        """(N c, m) whitened displacements of a model's terms, at their scales."""
        scaled = (self.groups.columns(term) * scale for term, scale in scales(model).items())
        return np.hstack([np.zeros((len(self.design.y), 0)), *scaled])

    def columns_at(self, design: Design, model: Posterior[Term]) -> Floats:
        """The same at the rows of another linear problem, with the references of this one."""
        at, own = design.operating_points, smooth_of(model)
        scaled = not any(term.motion == "scale" for term in own)
        smooth: dict[Term, Displacement] = dict(smooth_terms(at, self.priors, scaled)) if own else {}
        found = [
            design.columns(term.basis(at) if isinstance(term, Hypothesis) else smooth[term]) * scale
            for term, scale in scales(model).items()
        ]
        return np.hstack([np.zeros((len(design.y), 0)), *found])

    def only(self, model: Posterior[Term], terms: Iterable[Term]) -> Posterior[Term]:
        """The model with only some of its terms, at the same scales."""
        wanted = set(terms)
        kept = [(t, s) for t, s in zip(model.terms, model.scale, strict=True) if t in wanted]
        return fixed(self.groups, [t for t, _ in kept], [s for _, s in kept]) if kept else NOTHING


def causes(model: Posterior[Term]) -> tuple[Hypothesis, ...]:
    """A model's hypotheses, without its smooth terms."""
    return tuple(term for term in model.terms if isinstance(term, Hypothesis))


def smooth_of(model: Posterior[Term]) -> tuple[SmoothTerm, ...]:
    """A model's smooth terms."""
    return tuple(term for term in model.terms if isinstance(term, SmoothTerm))


def scales(model: Posterior[Term]) -> Mapping[Term, float]:
    """The scale of each term of a model."""
    return dict(zip(model.terms, model.scale, strict=True))


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
    return best


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


FEW_LINES = 3
"""Where a periodic error has fewer other lines than this, a line is estimated again by a scan of all periods; otherwise about
fifty periods near its last one are tried. Assumed."""
SAME_PERIOD = 0.1
"""Change of a period, in standard deviations, below which the line is not changed. Assumed."""
SHORT_STEP = 0.5
"""Largest step of Newton's method to a better period, and its largest standard deviation, in steps of the scan, of which there
are six in the width of a maximum. Otherwise periods near the last one are tried."""
LINE_SWEEPS, LINES_CONVERGED = 6, 0.1
"""Most times that all lines are estimated again, and the gain in log posterior, nats, below which this stops. Assumed."""


def further_lines(
    hypotheses: HypothesisSet,
    model: Posterior[Term],
    terms: Collection[Hypothesis] | None = None,
    last: dict[tuple[str, str], float] | None = None,
    every: bool = True,
) -> tuple[float, Hypothesis, Hypothesis] | None:
    """The periodic error of a model that gains most by more lines: (gain, hypothesis with these lines, hypothesis without).

    The gain is in log posterior, nats, to first order. None where no line gains.

    ``terms``: only these of its periodic errors. ``last``: gains of each periodic error in an earlier, smaller model, by place;
    they are updated here. A line seldom gains more in a larger model, so those that gained less than the best one now are not
    computed again; those that gained nothing only where ``every`` is true, and no other gains.
    """
    if not hypotheses.long or len(model.mean) >= hypotheses.priors.most_coefficients * hypotheses.design.count:
        return None
    best: tuple[float, Hypothesis, Hypothesis] | None = None
    last = {} if last is None else last
    for term in sorted(causes(model) if terms is None else terms, key=lambda t: -last.get(t.place, np.inf)):
        if (best or not every) and last.get(term.place, np.inf) <= (best[0] if best else 0.0):
            break
        if not 0 < len(term.values) < term.effect.most_values or term.template not in hypotheses.scanned:
            continue
        line = hypotheses.scanned_gain(term.template, model, term.values)
        gain = line.value - hypotheses.priors.line
        last[term.place] = gain + line.more if gain > 0.0 else 0.0
        if last[term.place] > (best[0] if best else 0.0) and isinstance(line.term, Hypothesis):
            best = (last[term.place], term.with_lines((*term.lines, *line.term.lines, *line.further)), term)
    return best


def with_all_lines(hypotheses: HypothesisSet, model: Posterior[Term], gain: Gain) -> Posterior[Term]:
    """A model with one more term, and with all its lines at once where there are several."""
    if not gain.further or not isinstance(gain.term, Hypothesis):
        return hypotheses.extended(model, gain.term)
    term = gain.term.with_lines((*gain.term.lines, *gain.further))
    found = _reestimate_lines(hypotheses, hypotheses.extended(model, term), term)
    return tuned(hypotheses.groups, found.terms, found.scale)


def widened(hypotheses: HypothesisSet, model: Posterior[Term], wider: Hypothesis, old: Hypothesis) -> Posterior[Term]:
    """A model with more lines in the place of one of its periodic errors, all of them estimated again."""
    found = _reestimate_lines(hypotheses, hypotheses.replaced(model, old, wider), wider)
    return tuned(hypotheses.groups, found.terms, found.scale)


def with_lines_reestimated(hypotheses: HypothesisSet, model: Posterior[Term]) -> Posterior[Term]:
    """The model with the lines of every periodic error estimated again until the gain is below ``LINES_CONVERGED``."""
    for place in [cause.place for cause in causes(model) if cause.further]:
        for _ in range(LINE_SWEEPS):
            term = next((cause for cause in causes(model) if cause.place == place), None)
            if term is None or not term.further:
                break
            found = _reestimate_lines(hypotheses, model, term)
            gained = hypotheses.log_posterior(found) - hypotheses.log_posterior(model)
            model = found
            if gained < LINES_CONVERGED:
                break
    return model


def with_lines(hypotheses: HypothesisSet, rest: Posterior[Term], term: Hypothesis) -> Posterior[Term]:
    """A model with one more hypothesis, and with each further line of it that increases the log posterior."""
    key = rest.terms, rest.scale, term
    if key not in hypotheses.models_with_lines:
        model = hypotheses.extended(rest, term)
        own = next(t for t in causes(model) if t.place == term.place)
        while (line := further_lines(hypotheses, model, (own,))) is not None:
            wider = widened(hypotheses, model, *line[1:])
            if hypotheses.log_posterior(wider) <= hypotheses.log_posterior(model) + 1e-9:
                break
            model, own = wider, next(t for t in causes(wider) if t.place == term.place)
        hypotheses.models_with_lines[key] = model
    return hypotheses.models_with_lines[key]


def _reestimate_lines(hypotheses: HypothesisSet, model: Posterior[Term], term: Hypothesis) -> Posterior[Term]:
    """The model with each line of a hypothesis estimated again given the others, or left out where that increases the log
    posterior; of many lines only those that would change."""
    for old, changes in zip(term.lines, _changing(hypotheses, model, term), strict=True):
        if not changes:
            continue
        if len(term.values) < 2:  # its lines were equal
            break
        less = term.with_lines([line for line in term.lines if line != old])
        without_it = hypotheses.replaced(model, term, less)
        candidates = [(less, without_it)] if len(less.values) > 1 else []
        found = _estimated(hypotheses, model, term, old, without_it, less)
        if abs(found[0] - old[0]) > SAME_PERIOD * found[1]:
            again = less.with_lines((*less.lines, found))
            candidates.insert(0, (again, hypotheses.replaced(without_it, less, again)))
        for candidate, trial in candidates:
            if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model) + 1e-6:
                model, term = trial, candidate
    return model


def _changing(hypotheses: HypothesisSet, model: Posterior[Term], term: Hypothesis) -> list[bool]:
    """Whether each line of a hypothesis may have another period given the others, or be left out."""
    if len(term.lines) <= FEW_LINES:
        return [True] * len(term.lines)
    at, groups = model.terms.index(term), hypotheses.groups
    place, scale = sum(model.widths[:at]), model.scale[at]
    best, sigma = hypotheses.scan(term.template).improved(model, term.values, place)
    found = np.abs(best - term.values) > SAME_PERIOD * sigma
    for i, part in enumerate(groups.parts(term)):
        own = slice(place, place + groups.width(part))
        found[i] |= without_coefficients(model, own, scale) + hypotheses.priors.line > 0.0
        place = own.stop
    return [bool(changes) for changes in found]


def _estimated(
    hypotheses: HypothesisSet,
    model: Posterior[Term],
    term: Hypothesis,
    old: tuple[float, float],
    without_it: Posterior[Term],
    others: Hypothesis,
) -> tuple[float, float]:
    """A line's period given the other lines, and its standard deviation; the old ones where no other is distinguished.

    ``model``, ``term``: with the line. ``without_it``, ``others``: without it. One step of Newton's method where it is short.
    """
    scan = hypotheses.scan(others.template)
    if len(others.values) < FEW_LINES:
        found = scan.best(without_it, others.values)
        return old if found.gain <= NO_GAIN else (found.value, found.sigma)
    at = model.terms.index(term)
    parts = hypotheses.groups.parts(term)
    before = term.values.index(old[0])
    first = sum(model.widths[:at]) + sum(hypotheses.groups.width(part) for part in parts[:before])
    (value,), (sigma,) = scan.improved(model, old[:1], first)
    short = max(abs(value - old[0]), sigma) < SHORT_STEP * scan.step(old[0])
    if short and scan.resolved(np.array([value]), others.values).all():
        return float(value), float(sigma)
    found = scan.near(without_it, old[0], others.values)
    return old if found.gain <= NO_GAIN else (found.value, found.sigma)


def strongest_first(hypotheses: HypothesisSet, model: Posterior[Term], cause: Hypothesis) -> Hypothesis:
    """A cause of a model with its lines by the size of their cores, the largest first; other causes as they are."""
    if not cause.further:
        return cause
    widths = [hypotheses.groups.width(term) for term in model.terms]
    place = model.terms.index(cause)
    start = sum(widths[:place])
    one = cause.basis(hypotheses.design.operating_points).sigma
    lines = (model.mean[start : start + widths[place]] * one).reshape(len(cause.values), -1)
    size = np.linalg.norm(lines[:, list(cause.effect.core)], axis=1)
    return cause.with_lines([cause.lines[i] for i in np.argsort(-size, kind="stable")])


def chance_lines(hypotheses: HypothesisSet, model: Posterior[Term]) -> tuple[Hypothesis, ...]:
    """The periodic errors of a model of which no line is significant against the scatter of its drive.

    A search compares a line with noise. Where an unknown error of a drive is larger than noise and has no period, many periods
    gain evidence, because each fits a part of it by chance. Here a line is compared with all that is left without it. Needed by
    a joint with random errors: tests/diagnosis/test_periodic_lines.py. Several lines, which follow any errors at the
    commands that chose them, also have to hold at others.
    """
    lines = [c for c in causes(model) if c.effect.of_own_command and c.effect.most_values > 1 and c.values]
    if not lines:
        return ()
    most, design, found = hypotheses.priors.chance_line, hypotheses.design, []
    for cause in lines:
        others = hypotheses.columns(hypotheses.only(model, set(model.terms) - {cause}))
        each = np.split(hypotheses.groups.columns(cause), len(cause.values), axis=1)
        periods = np.array(cause.effect.nonlinear_values(design.operating_points, cause.site))
        fitted = FittedLines.of(design, others, each, cause.site, len(periods))
        if fitted.chance() > most or (cause.further and fitted.held(periods) < hypotheses.priors.lines_hold):
            found.append(cause)
    return tuple(found)
