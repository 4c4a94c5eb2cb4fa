"""The hypothesis set: all explanations (hypotheses, smooth terms, proxies), and the log prior odds against each."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from math import comb, log
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, Posterior, all_gains, exchanged, fixed, gain, tuned
from gtpin.diagnosis.hypothesis import Hypothesis, Scope, SmoothTerm, modulates, related
from gtpin.diagnosis.priors import Priors
from gtpin.diagnosis.proxies import Proxy, proxies
from gtpin.diagnosis.scan import Scan
from gtpin.diagnosis.smooth_terms import smooth_terms
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.untestable import Untestable, as_untestable
from gtpin.model.fit_conditions import TEMPERATURES
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
        divided = "session" in explained_by(term).drivers(self.design.operating_points.robot)
        return self.threshold + unnamed + (self.of_sessions if divided else 0.0)

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


def smooth_of(model: Explanation) -> tuple[SmoothTerm, ...]:
    """A model's smooth terms."""
    return tuple(term for term in model.terms if isinstance(term, SmoothTerm))


def scales(model: Explanation) -> Mapping[Term, float]:
    """The scale of each explanation of a model."""
    return dict(zip(model.terms, model.scale, strict=True))


FEWEST_SESSIONS = 2
"""Fewest sessions that are left: with one, no effect of sessions can be tested."""


def propose(design: Design, scope: Scope, *, changes: bool = False) -> HypothesisSet:
    """Divide the effects of a scope, at all their sites, into those that the data can test and those that they can't.

    ``changes``: of effects since an earlier model, whose uncertainty B has; without smooth terms, proxies and scans.
    """
    at, marginal = design.operating_points, Marginal(design.B)
    linear: list[Hypothesis] = []
    scanned: list[Hypothesis] = []
    untested: list[Untested] = []
    for hypothesis in scope.hypotheses(at.robot):
        effect, site = hypothesis.effect, hypothesis.site
        reason = _no_change(at, hypothesis) if changes else as_untestable(effect.untestable(at, site))
        many = not changes and reason is None and len(effect.nonlinear_values(at, site)) > 0
        basis = hypothesis.checked(at) if reason is None else None
        if basis is not None and not many:
            # Whether geometry or uncertainty of the model absorb nearly all even of many times the typical size.
            X = design.columns(basis) * scope.priors.large
            if float(np.trace(marginal.product(X, X))) <= scope.priors.shows:
                reason = Untestable("uncertain" if changes else "absorbed")
        if reason:
            untested.append(Untested(hypothesis, reason))
        else:
            (scanned if many else linear).append(hypothesis)
    if changes:
        return HypothesisSet(design, linear, (), (), scope, untested, proxied=False)
    design, odds = merged_sessions(design, marginal, linear, scope.priors)
    at = design.operating_points
    scaled = any(hypothesis.effect.stretches_frame for hypothesis in linear)
    smooth = tuple(smooth_terms(at, scope.priors, scaled))
    return HypothesisSet(design, linear, scanned, smooth, scope, untested, of_sessions=odds)


def _no_change(at: OperatingPoints, hypothesis: Hypothesis) -> Untestable | None:
    """Why a check can't test an effect as a change; temperatures that do not vary are no reason."""
    effect = hypothesis.effect
    if effect.since_a_model:
        return None
    if effect.has_nonlinear:
        return Untestable("not_searched")
    reason = as_untestable(effect.untestable(at, hypothesis.site))
    if reason is not None and reason.kind == "constant" and reason.covariate in TEMPERATURES:
        return None
    return reason


def merged_sessions(
    design: Design, marginal: Marginal, hypotheses: Sequence[Hypothesis], priors: Priors
) -> tuple[Design, float]:
    """A linear problem in which consecutive sessions without a change between them are one session.

    Coefficients of a session that has none of its own cost evidence, so that a second label within a session would make a
    certain shift between sessions doubtful. The effects of sessions are taken together, each session with one set of their
    coefficients. Two neighbours are merged where equal sets are more probable than different ones (Savage-Dickey density
    ratio), first those of the largest ratio. ``hypotheses``: those that can be tested.

    Returns the problem, and the natural logarithm of the number of ways to divide the sessions into as many: log prior odds,
    nats, against each effect of sessions.
    """
    at = design.operating_points
    labels = at.references.sessions
    if len(labels) <= FEWEST_SESSIONS or not at.varies("session"):
        return design, 0.0
    names = np.array([str(name) for name in at.covariates["session"]])
    if at.has("time"):
        labels = tuple(sorted(labels, key=lambda label: float(at.covariate("time")[names == label].mean())))
    members = np.array([names == label for label in labels])
    parts = [_by_session(design, h, members) for h in hypotheses if "session" in h.covariates(at.robot)]
    found = [part for part in parts if part is not None]
    if not found:
        return design, 0.0
    groups: Groups[str] = Groups(marginal, design.y, priors)
    groups.add("all", np.concatenate(found, axis=2).transpose(1, 0, 2).reshape(len(design.y), -1))
    scale = gain(groups, NOTHING, "all")[1]
    posterior = fixed(groups, ("all",), (scale,))
    together = _together(posterior.mean, posterior.covariance, scale, len(labels))
    if len(together) == len(labels):
        return design, 0.0
    new = {labels[i]: labels[group[0]] for group in together for i in group}
    column = np.array([new[name] for name in names], dtype=object)
    changed = replace(design, operating_points=at.with_covariate("session", column))
    return changed, log(comb(len(labels) - 1, len(together) - 1))


def _by_session(design: Design, hypothesis: Hypothesis, members: npt.NDArray[np.bool_]) -> Floats | None:
    """(K, N c, m) whitened displacements by the m coefficients of each of K sessions; None if they are not of one session."""
    X = design.columns(hypothesis.basis(design.operating_points))
    each, left = divmod(X.shape[1], len(members))
    if left or not each:
        return None
    rows = np.repeat(members, design.components, axis=1)
    # Columns belong to the only session in which they are not zero, in whatever order the effect has them.
    inside = np.array([(X[own] != 0.0).any(axis=0) for own in rows])
    if (inside.sum(axis=0) != 1).any() or (inside.sum(axis=1) != each).any():
        return None
    return np.stack([X[:, own] for own in inside])


def _together(mean: Floats, covariance: Floats, scale: float, count: int) -> list[list[int]]:
    """Groups of consecutive sessions, given the posterior of ``count`` sets of coefficients, of prior variance scale^2 each."""
    found, width = [[i] for i in range(count)], len(mean) // count

    def equal(a: list[int], b: list[int]) -> tuple[float, Floats, slice, slice]:
        """Log density of equal coefficients in the posterior less that in the prior; the gain matrix that makes them equal; and
        the coefficients of both groups: those of their first sessions."""
        own, other = slice(a[0] * width, (a[0] + 1) * width), slice(b[0] * width, (b[0] + 1) * width)
        d, across = mean[own] - mean[other], covariance[:, own] - covariance[:, other]
        factor = cho_factor(across[own] - across[other], lower=True)
        before = scale**2 * (1.0 / len(a) + 1.0 / len(b))  # of the difference of two means of independent coefficients
        ratio = -0.5 * float(d @ cho_solve(factor, d)) - float(np.log(np.diag(factor[0])).sum())
        return ratio + 0.5 * width * log(before), cho_solve(factor, across.T).T, own, other

    while len(found) > FEWEST_SESSIONS:
        tried = [equal(a, b) for a, b in pairwise(found)]
        best = int(np.argmax([ratio for ratio, *_ in tried]))
        ratio, gain_, own, other = tried[best]
        if ratio <= 0.0:
            break
        mean = mean - gain_ @ (mean[own] - mean[other])
        covariance = covariance - gain_ @ (covariance[own] - covariance[other])
        found[best : best + 2] = [found[best] + found[best + 1]]
    return found
