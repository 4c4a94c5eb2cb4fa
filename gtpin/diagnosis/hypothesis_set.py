"""The terms that a model can have, their gains in log evidence, their prior odds, and the log posterior of a model.

The log posterior of a model m, but for a constant, is its log evidence less the cost of each of its terms:

    ln Lambda(m) - sum of kappa_k over the terms k of m,

with kappa_k of :meth:`HypothesisSet.costs`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, Posterior, all_gains, exchanged, fixed, tuned
from gtpin.diagnosis.hypothesis import Hypothesis, Proxy, Scope, SmoothTerm, Term, explained_by, modulates, related
from gtpin.diagnosis.scan import Scan
from gtpin.diagnosis.smooth_terms import smooth_terms
from gtpin.effects.displacement import Displacement
from gtpin.effects.untestable import Untestable
from gtpin.typing import Floats

T = TypeVar("T", bound=Term)


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
        Nor where a track is not straight and its cart turns: a profile has no equation from which it could depart.
        """
        robot, a, b = self.design.operating_points.robot, explained_by(term), explained_by(stronger)
        both = [one.effect for one in (a, b) if isinstance(one, Hypothesis)]
        if len(both) == 2 and (
            (robot.joint_sites and all(effect.load for effect in both))
            or (a.site == b.site and all(effect.nature == "profile" for effect in both))
        ):
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
