"""The hypothesis set: all explanations (hypotheses, smooth terms, proxies), and the log prior odds against each."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis, Scope, SmoothTerm, modulates, related
from gtpin.diagnosis.hypotheses.proxies import Proxy, proxies
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import Groups, Marginal
from gtpin.diagnosis.linear.posterior import NOTHING, Posterior, all_gains, exchanged, fixed, tuned
from gtpin.diagnosis.linear.scan import Scan
from gtpin.effects.displacement import Displacement
from gtpin.effects.untestable import Untestable
from gtpin.typing import Floats

Term = Hypothesis | SmoothTerm | Proxy
Explanation = Posterior[Term]
"""Some members of the hypothesis set together, each with its scale."""
T = TypeVar("T", bound=Term)


class Gain(NamedTuple):
    """Gain by one more explanation.

    ``value``: gain in log evidence, nats. ``term``: the explanation, with its nonlinear parameter estimated. ``further``: for a
    periodic error that can have several lines: the other lines (period, sigma) that are worth adding with the first. ``more``:
    additional gain by these lines less the prior odds against them, nats.
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
    """Explanations, and the inner products of their displacements.

    A hypothesis with another value of its nonlinear parameter is another hypothesis. So a model that a search rejects does
    not change the models that it keeps.

    ``linear``: hypotheses without a nonlinear parameter. ``scanned``: hypotheses whose
    nonlinear parameter is scanned, without a value of it. ``smooth``: smooth terms with their displacements. ``scope``: gives
    the probability of a false alarm, and the priors. ``untested``: effects that can't be tested: those that lack a covariate
    may have a proxy. ``of_sessions``: additional log prior odds against explanations that depend on the session, nats.
    ``proxied``: whether effects that lack a covariate have proxies.

    ``threshold`` has the log prior odds against a first named cause, nats: ln(number of hypotheses / ``scope.false_alarm``).
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
        proxied: bool = True,
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
        self.of_sessions, self.proxied = of_sessions, proxied
        self._scans: dict[Hypothesis, Scan] = {}
        self.lined: dict[tuple[tuple[Term, ...], tuple[float, ...], Hypothesis], Explanation] = {}
        """Models with all lines of a periodic error, by terms and scales of the model without the error, and its first line."""
        self.grown: dict[tuple[Term, tuple[Term, ...], int], Explanation] = {}
        """Models of earlier searches: by first explanation, allowed explanations, and number of explanations."""
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
        """All explanations that a model can have."""
        return (*self.named, *self.smooth)

    @cached_property
    def proxies(self) -> tuple[Proxy, ...]:
        """Effects with a proxy of a covariate that was not recorded; never in a model, only alternatives to its causes."""
        if not self.proxied:
            return ()
        found = tuple(proxies(self.design, [one.hypothesis for one in self.untested], self.linear, self.priors))
        for proxy in found:
            self.groups.add(proxy, proxy.columns)
        return found

    def at_threshold(self, threshold: float) -> HypothesisSet:
        """The same explanations, with other log prior odds, nats, against a first named cause."""
        other = copy(self)
        other.threshold, other.lined, other.grown, other._costs = threshold, {}, {}, {}
        return other

    def barring(self, places: Collection[tuple[str, str]]) -> HypothesisSet:
        """The same explanations without the hypotheses at some places (effect, site)."""
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
        """Log prior odds against an explanation as the only one, nats: its gain in log evidence must exceed them."""
        unnamed = self.priors.unnamed if isinstance(term, SmoothTerm) else 0.0
        robot, one = self.design.operating_points.robot, explained_by(term)
        carried = isinstance(one, Hypothesis) and one.site == "platform" and one.clock(robot) is not None
        moved = self.priors.same_clock if carried else 0.0
        return self.threshold + unnamed + moved + (self.of_sessions if "session" in one.drivers(robot) else 0.0)

    def share(self, term: Term, stronger: Term) -> float:
        """Share of a stronger explanation's evidence that is added to the prior odds against ``term``."""
        robot, a, b = self.design.operating_points.robot, explained_by(term), explained_by(stronger)
        if a.site == b.site and a.drivers(robot) & b.drivers(robot):
            return self.priors.same
        return self.priors.related if related(robot, a, b) else self.priors.other

    def costs(self, terms: Sequence[Term]) -> dict[Term, float]:
        """Log prior odds against each explanation of a model, nats."""
        templates = tuple(self.without_value(term) for term in terms)
        if templates not in self._costs:
            alone, found = {term: self.alone(term) for term in templates}, []
            for term in templates:
                stronger = [self.share(term, t) * alone[t] for t in templates if alone[t] > alone[term]]
                third = self.priors.third if len(stronger) > 1 else 0.0
                found.append(self.cost(term) + max(stronger, default=0.0) + third)
            self._costs[templates] = tuple(found)
        lines = (len(term.further) if isinstance(term, Hypothesis) else 0 for term in terms)
        return {
            term: cost + self.priors.line * more
            for term, cost, more in zip(terms, self._costs[templates], lines, strict=True)
        }

    def alone(self, term: Term) -> float:
        """Gain in log evidence of an explanation as the only one, with the best value of its nonlinear parameter."""
        open_ = self.without_value(term)
        return self.gains(NOTHING, (open_,))[open_].value

    def log_posterior(self, model: Explanation) -> float:
        """Worth of a model: its log evidence less the log prior odds against its explanations, nats."""
        return model.log_evidence - sum(self.costs(model.terms).values())

    def net_gains(self, model: Explanation, terms: Iterable[T]) -> dict[T, Gain]:
        """Gain in worth, nats, by adding each explanation to a model whose scales are not changed."""
        before = sum(self.costs(model.terms).values())
        return {
            term: gain._replace(value=gain.value - sum(self.costs((*model.terms, gain.term)).values()) + before)
            for term, gain in self.gains(model, terms).items()
        }

    def gains(self, model: Explanation, terms: Iterable[T]) -> dict[T, Gain]:
        """Gain in log evidence by adding each explanation to a model, with its nonlinear parameter estimated given the model.

        The scales of the model are not changed. Explanations that the model already has, with any value of the nonlinear
        parameter, are left out.
        """
        known = self._gains.setdefault((model.terms, model.scale), {})
        taken = {self.without_value(term) for term in model.terms}
        wanted = [term for term in terms if self.without_value(term) not in taken]
        new = [term for term in wanted if term not in known]
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

    def scanned_gain(self, hypothesis: Hypothesis, model: Explanation, others: Sequence[float] = ()) -> Gain:
        """Gain by the best value of a hypothesis of ``scanned``; ``others``: its values that the model already has."""
        best = self.scan(hypothesis).best(model, others)
        term = Hypothesis(hypothesis.effect, hypothesis.site, best.value, best.sigma)
        room = hypothesis.effect.most_values - 1 - len(others)
        if not self.long or room < 1:
            return Gain(best.gain, term)
        worth = [line for line in best.others if line[2] > self.priors.line][:room]
        more = sum(gain - self.priors.line for _, _, gain in worth)
        return Gain(best.gain, term, tuple((value, sigma) for value, sigma, _ in worth), more)

    def replaced(self, model: Explanation, old: Hypothesis, new: Hypothesis) -> Explanation:
        """The model with one hypothesis in the place of another, at the same scales."""
        if new not in self.groups:
            self._add(new)
        return exchanged(self.groups, model, old, new)

    def extended(self, model: Explanation, term: Term) -> Explanation:
        """A model with one more explanation, all scales estimated again."""
        return self.of((*model.terms, term), (*model.scale, 1.0))

    def of(self, terms: Sequence[Term], scale: Sequence[float]) -> Explanation:
        """A model of some explanations, its scales estimated from given ones."""
        for term in terms:
            if isinstance(term, Hypothesis) and term not in self.groups:
                self._add(term)
        return tuned(self.groups, terms, scale)

    def modulates(self, smooth: SmoothTerm, model: Explanation | Collection[Hypothesis]) -> bool:
        """Whether a smooth term is only a modulation of one of some hypotheses."""
        terms = model.terms if isinstance(model, Posterior) else model
        at = self.design.operating_points
        return any(isinstance(term, Hypothesis) and modulates(at, smooth, term) for term in terms)

    def columns(self, model: Explanation) -> Floats:
        """(N c, m) whitened displacements of a model's explanations, at their scales."""
        scaled = (self.groups.columns(term) * scale for term, scale in scales(model).items())
        return np.hstack([np.zeros((len(self.design.y), 0)), *scaled])

    def only(self, model: Explanation, terms: Iterable[Term]) -> Explanation:
        """The model with only some of its explanations, at the same scales."""
        wanted = set(terms)
        kept = [(t, s) for t, s in zip(model.terms, model.scale, strict=True) if t in wanted]
        return fixed(self.groups, [t for t, _ in kept], [s for _, s in kept]) if kept else NOTHING


def explained_by(term: Term) -> Hypothesis | SmoothTerm:
    """The hypothesis of a proxy; other terms unchanged."""
    return term.hypothesis if isinstance(term, Proxy) else term


def causes(model: Explanation) -> tuple[Hypothesis, ...]:
    """A model's hypotheses, without its smooth terms."""
    return tuple(term for term in model.terms if isinstance(term, Hypothesis))


def smooth_terms(model: Explanation) -> tuple[SmoothTerm, ...]:
    """A model's smooth terms."""
    return tuple(term for term in model.terms if isinstance(term, SmoothTerm))


def scales(model: Explanation) -> Mapping[Term, float]:
    """The scale of each explanation of a model."""
    return dict(zip(model.terms, model.scale, strict=True))
