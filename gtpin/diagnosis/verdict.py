"""From evidence to a conclusion: which causes are named, and whether something unknown is needed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from gtpin.diagnosis.classes import (
    ClassMember,
    class_of,
    ranked,
    unnamed,
    with_all_actuators,
    with_equal_actuators,
    with_further_load,
    with_shared_loads,
    with_two_instead,
)
from gtpin.diagnosis.evidence import NOTHING, Posterior, fixed, marginal_power, tuned, without
from gtpin.diagnosis.hypothesis import Hypothesis, Proxy, SmoothTerm, Term, alike
from gtpin.diagnosis.hypothesis_set import HypothesisSet, causes, scales, smooth_of
from gtpin.diagnosis.noise import SearchState, drive_beyond_noise, reestimate_noise
from gtpin.diagnosis.periodic_lines import chance_lines
from gtpin.diagnosis.priors import LIKELY, SURE
from gtpin.diagnosis.propose import UNLOADED
from gtpin.diagnosis.result import Considered, Doubt, FlexibleFamily, Member, Undecided, Verdict
from gtpin.diagnosis.search import pays, search, with_residuals
from gtpin.effects.effect import Nature


@dataclass(frozen=True)
class Conclusion:
    """The conclusion from the evidence: causes, their classes, and doubts.

    ``model``: the causes that are named. ``classes``: for each cause its class with the cause itself, the most probable member
    first. ``doubts``: reasons for which something unknown is assumed in addition to the causes. ``beside``: the smooth terms
    that are needed beside the causes.
    ``also``: those causes that are weak and undecided: they do not change the verdict. ``descriptions``: flexible families that
    fit and are no causes. ``mechanisms``: places of the causes that are such families, but have a mechanism's form.
    ``likely``: places of likely causes that are not named, because they could be the unknown themselves.
    """

    model: Posterior[Term]
    classes: Mapping[Hypothesis, tuple[ClassMember, ...]]
    doubts: tuple[Doubt, ...]
    beside: Posterior[Term] = NOTHING
    also: tuple[Hypothesis, ...] = ()
    descriptions: tuple[FlexibleFamily, ...] = ()
    mechanisms: frozenset[tuple[str, str]] = frozenset()
    likely: tuple[tuple[str, str], ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The verdict: the first of ``unknown``, ``ambiguous``, ``explained`` and ``none`` that applies."""
        if self.doubts:
            return "unknown"
        if len(self.sure()) < len(self.classes) - len(self.also):
            return "ambiguous"
        return "explained" if self.classes else "none"

    @property
    def scale(self) -> Mapping[Term, float]:
        """Scale of each cause: its size over the typical size."""
        return scales(self.model)

    def whole(self, hypotheses: HypothesisSet) -> Posterior[Term]:
        """The model of the causes with the smooth terms beside them."""
        model, beside = self.model, self.beside
        if not beside.terms:
            return model
        return fixed(hypotheses.groups, (*model.terms, *beside.terms), (*model.scale, *beside.scale))

    def doubted(self, *doubts: Doubt) -> Conclusion:
        """The conclusion with further doubts."""
        return replace(self, doubts=(*self.doubts, *doubts))

    def bounded(self, causes: Collection[Hypothesis], most: float) -> Conclusion:
        """The conclusion with a largest probability of the members of some causes' classes."""
        if not causes:
            return self
        classes = dict(self.classes)
        for cause in causes:
            share = min(most / classes[cause][0].probability, 1.0)
            classes[cause] = tuple(replace(m, probability=share * m.probability) for m in classes[cause])
        return replace(self, classes=classes)

    def only(self, hypotheses: HypothesisSet, causes: list[Hypothesis]) -> Conclusion:
        """The conclusion with only some of its causes."""
        classes = {cause: self.classes[cause] for cause in causes}
        return replace(self, model=hypotheses.only(self.model, causes), classes=classes)

    def named_beside_unknown(self, hypotheses: HypothesisSet) -> Conclusion:
        """The conclusion with only the causes that stand beside something unknown, and with what is weak and undecided.

        A cause A that is not sure may be a part of the unknown. A cause B that gains less than A, and that looks like a member
        of A's class, may be no more than what that member leaves of the unknown: it is named only where it gains more than
        twice its cost beside every other member in A's place, and beside the best smooth term there. Of causes that are not
        named, the leader of a class is likely where it has 0.5 or more.
        """
        robot, model, groups = hypotheses.design.operating_points.robot, self.whole(hypotheses), hypotheses.groups
        loss = {cause: model.log_evidence - without(groups, model, cause).log_evidence for cause in self.classes}
        beside, sure = {*self.beside_unknown(), *self.also}, self.sure()
        open_ = [cause for cause in self.classes if cause not in sure]

        def within(cause: Hypothesis, other: Hypothesis) -> bool:
            members = [m.hypothesis for m in self.classes[other]]
            if loss[cause] >= loss[other] or not any(alike(robot, cause, member) for member in members):
                return False
            rest = without(groups, model, other, sweeps=1)
            smooth = hypotheses.gains(rest, unnamed(hypotheses, other))
            instead: list[Term] = [m.hypothesis for m in self.classes[other] if m.recorded]
            instead += sorted(smooth, key=lambda term: -smooth[term].value)[:1]
            trials = (hypotheses.extended(rest, term) for term in instead if term not in model.terms)
            return not all(pays(hypotheses, trial, cause) for trial in trials)

        kept = [c for c in self.classes if c in beside and not any(within(c, other) for other in open_)]
        leaders = [members[0] for cause, members in self.classes.items() if cause not in kept]
        if not leaders:
            return self
        likely = (m.hypothesis.place for m in leaders if m.probability >= LIKELY)
        return replace(self.only(hypotheses, kept), likely=(*self.likely, *likely))

    def nature(self, cause: Hypothesis) -> Nature:
        """The nature of a cause: a flexible family is a mechanism only where its form was found to be one."""
        return "mechanism" if cause.place in self.mechanisms else cause.effect.nature_of(cause.lines)

    def members(self, cause: Hypothesis) -> tuple[Member, ...]:
        """The class of a cause, as it is reported."""
        return tuple(
            Member(*m.hypothesis.place, m.probability, m.recorded, m.beside.place if m.beside else None)
            for m in self.classes[cause]
        )

    def sure(self) -> list[Hypothesis]:
        """Causes that lead their class with a probability of 0.95 or more."""
        return [
            cause
            for cause, members in self.classes.items()
            if members[0].hypothesis.place == cause.place and members[0].probability >= SURE
        ]

    def beside_unknown(self) -> list[Hypothesis]:
        """Causes that stand beside something unknown: they lead their class with 0.5 or more."""
        return [
            cause
            for cause, members in self.classes.items()
            if members[0].hypothesis.place == cause.place and members[0].probability >= LIKELY
        ]


def considered(
    hypotheses: HypothesisSet, found: Conclusion, could_be: Collection[tuple[str, str]] = ()
) -> tuple[Considered, ...]:
    """All hypotheses that were tested, the largest gain in log evidence first, then those that could not be tested."""
    members = [m for every in found.classes.values() for m in every]
    probability = {m.hypothesis.place: m.probability for m in sorted(members, key=lambda m: m.probability)}
    lacking = {m.hypothesis.place for m in members if not m.recorded}
    asked = {p.hypothesis.place: p.reason for p in hypotheses.proxies if p.hypothesis.place in lacking | set(could_be)}
    reason = dict.fromkeys(lacking, UNLOADED) | asked
    alone = hypotheses.gains(NOTHING, hypotheses.named)
    tested = [
        Considered(*h.place, alone[h].value, probability.get(h.place, 0.0), True, reason.get(h.place))
        for h in hypotheses.named
    ]
    others = [
        Considered(*u.hypothesis.place, 0.0, probability.get(u.hypothesis.place, 0.0), False, u.reason)
        for u in hypotheses.untested
    ]
    return (*sorted(tested, key=lambda row: -row.log_evidence), *others)


def infer(settled: SearchState, barred: Collection[tuple[str, str]] = ()) -> Conclusion:
    """Search, compare named causes with smooth terms, and look for an actuator whose errors change too fast for these terms.

    Periodic errors that scatter alone would show are barred in a further search. ``barred``: effects and sites that cannot be
    causes.
    """
    hypotheses, scattered = settled.hypotheses, set[tuple[str, str]]()
    while True:
        out = {*barred, *scattered}
        allowed, guess = hypotheses.barring(out) if out else hypotheses, settled.guess
        if out:
            guess = allowed.only(guess, [t for t in guess.terms if not isinstance(t, Hypothesis) or t.place not in out])
        found = decide(allowed, guess)
        if not (by_chance := chance_lines(hypotheses, found.model)):
            break
        scattered |= {cause.place for cause in by_chance}
    if found.doubts:
        return found
    sites = tuple(sorted({site for _, site in scattered}))
    site = drive_beyond_noise(hypotheses, found.model, sites) if sites else None
    if site is None:
        site = reestimate_noise(settled.observed, hypotheses, found.model).drive_beyond_noise
    if site is None:
        return found
    # Errors of this actuator change too fast for smooth terms: causes of other sites are kept where they are sure.
    own = f"q{hypotheses.design.operating_points.robot.sites.index(site) + 1}"
    kept = found.only(hypotheses, [cause for cause in found.beside_unknown() if cause.site != site])
    return kept.doubted(Doubt("restless", site, (own,)))


def decide(hypotheses: HypothesisSet, guess: Posterior[Term] = NOTHING) -> Conclusion:
    """Search with and without smooth terms, compare both models, and conclude which causes are named.

    ``guess``: a model that an earlier search found. The searches of a robot without rods, whose models are long, start from it.
    """
    start = guess if hypotheses.long else NOTHING
    named = search(hypotheses, hypotheses.named, start=hypotheses.only(start, causes(start)))
    mixed = with_residuals(hypotheses, search(hypotheses, hypotheses.every, start=start))
    needed = smooth_of(mixed)
    if needed and _unknown(hypotheses, mixed, named) > 0.5:
        named = hypotheses.only(mixed, (*_apart(hypotheses, mixed), *needed))
    elif needed := _replacing(hypotheses, named):
        better = tuned(hypotheses.groups, (*named.terms, *needed), (*named.scale, *(1.0 for _ in needed)))
        named = hypotheses.only(better, (*_apart(hypotheses, better), *needed))
    named = without_redundant(hypotheses, named)
    # The smooth terms stay in the model while classes are compared: else an alternative would gain by what they explain.
    named, classes = _with_leaders(hypotheses, named)
    instead: list[tuple[str, str]] = []
    for cause in [cause for cause, members in classes.items() if cause.further and members[0].probability >= SURE]:
        if (replaced := _without_lines(hypotheses, named, cause)) is not None:
            named, needed = replaced, smooth_of(replaced)
            instead.append(cause.place)
            del classes[cause]
    if not needed:  # where something is unknown, the second of two would explain that, not what the cause explains
        classes = dict(with_two_instead(hypotheses, named, classes))
    for more in (with_shared_loads, with_all_actuators, with_equal_actuators, with_further_load):
        classes = dict(more(hypotheses, named, classes))
    doubts = tuple(Doubt("smooth_term", term.site, term.over) for term in needed)
    model, unknown = hypotheses.only(named, causes(named)), hypotheses.only(named, needed)
    found = Conclusion(model, classes, doubts, unknown, likely=tuple(instead))
    return found.named_beside_unknown(hypotheses) if doubts else found


def _with_leaders(
    hypotheses: HypothesisSet, named: Posterior[Term]
) -> tuple[Posterior[Term], dict[Hypothesis, tuple[ClassMember, ...]]]:
    """The model with the most probable member of each class in the place of its cause, and the classes.

    The search compares models by their log posterior, in which what may imitate a stronger cause has a larger penalty than in
    a class. Needed by two joints that give way, of which the second was a periodic error:
    tests/diagnosis/test_leaders_of_classes.py.
    """
    classes = {cause: class_of(hypotheses, named, cause) for cause in causes(named)}
    for cause in causes(named):
        best = classes[cause][0]
        if best.hypothesis.place == cause.place or not best.recorded or best.hypothesis in named.terms:
            continue
        rest = without(hypotheses.groups, named, cause, sweeps=1)
        led = hypotheses.extended(rest, best.hypothesis)
        if class_of(hypotheses, led, best.hypothesis)[0].hypothesis.place == best.hypothesis.place:
            named = led
            classes = {one: class_of(hypotheses, named, one) for one in causes(named)}
    return named, classes


def _unknown(hypotheses: HypothesisSet, mixed: Posterior[Term], named: Posterior[Term]) -> float:
    """Probability of the model with smooth terms ``mixed``, m_s, as opposed to ``named``, m_n, without.

        P = 1 / (1 + exp(-D / T)),    D = log posterior of m_s - log posterior of m_n - d (ln Lambda(m_s) - ln Lambda(m_c))

    m_c has the causes of m_s alone, and d is ``departure`` or, where the smooth terms can be a modulation of a named cause,
    ``modulation``: a cause's departure from its equation gains that share of the evidence.
    """
    priors = hypotheses.priors
    known = hypotheses.only(mixed, causes(mixed))
    modulation = all(hypotheses.modulates(smooth, named) for smooth in smooth_of(mixed))
    doubt = (priors.modulation if modulation else priors.departure) * (mixed.log_evidence - known.log_evidence)
    ahead = hypotheses.log_posterior(mixed) - hypotheses.log_posterior(named) - doubt
    return float(expit(ahead / priors.temperature_of(named.log_evidence)))


def _replacing(hypotheses: HypothesisSet, named: Posterior[Term]) -> tuple[SmoothTerm, ...]:
    """Smooth terms that are more probable than a cause and its whole class.

    Without it, one of 54 frozen cases has a cause of 0.6 beside the unknown; with it, none.
    """
    found: list[SmoothTerm] = []
    for cause in causes(named):
        every = ranked(hypotheses, named, cause)
        listed = sum(member.probability for member in every.members(cause))
        found += [term for term, probability in every.smooth[:1] if probability > listed]
    return tuple(dict.fromkeys(found))


def _without_lines(hypotheses: HypothesisSet, named: Posterior[Term], cause: Hypothesis) -> Posterior[Term] | None:
    """The model with a smooth function of the actuator's own command in place of a periodic error.

    Beside this function, no line gains more than its prior odds cost. None if there is no such function.

    Several lines follow any local or rough error of a drive as a Fourier series, and often better than a smooth term, whose
    spectrum is another one. A gear's line is larger than its neighbours, and gains beside such a term as well.
    """
    own = (f"q{hypotheses.design.operating_points.robot.sites.index(cause.site) + 1}",)
    rest = without(hypotheses.groups, named, cause, sweeps=1)
    for term in (s for s in hypotheses.smooth if s.site == cause.site and s.over == own and s.motion != "aside"):
        model = tuned(hypotheses.groups, (*rest.terms, term), (*rest.scale, 1.0))
        if hypotheses.gains(model, (cause.template,))[cause.template].value < hypotheses.cost(cause.template):
            return model
    return None


def _apart(hypotheses: HypothesisSet, model: Posterior[Term]) -> tuple[Hypothesis, ...]:
    """Causes that gain more than twice the prior odds against them, and more than every smooth term that they can look like.

    What a smooth term leaves of an unknown motion is smaller than what it explains, and a cause may be no more than that.
    """
    sure = []
    loss = {t: model.log_evidence - without(hypotheses.groups, model, t).log_evidence for t in model.terms}
    for cause in causes(model):
        like = [loss[term] for term in smooth_of(model) if _alike(hypotheses, cause, (term,))]
        if pays(hypotheses, model, cause) and loss[cause] > max(like, default=0.0):
            sure.append(cause)
    return tuple(sure)


FAST = 5.0
"""Number of periods in the travel from which a line is too fast for a smooth term of another site: twice that of the shortest
wave of these that several joints share: five half waves of two commands, three of the position (``smooth_terms.py``)."""


def _alike(hypotheses: HypothesisSet, cause: Hypothesis, smooth: Sequence[SmoothTerm]) -> bool:
    """Whether a cause can look like one of some smooth terms.

    Smooth terms vary too slowly to follow lines, so several lines of a joint can't be confused with them; nor can one of a
    short period with those of other sites.
    """
    at = hypotheses.design.operating_points
    robot = at.robot
    if cause.further and hypotheses.long:
        return False
    if hypotheses.long and cause.effect.most_values > 1 and cause.values:
        turns = np.ptp(at.q[:, robot.sites.index(cause.site)]) / cause.values[0]
        smooth = [term for term in smooth if term.site == cause.site or turns < FAST]
    return any(alike(robot, cause, term) for term in smooth)


def without_redundant(hypotheses: HypothesisSet, named: Posterior[Term]) -> Posterior[Term]:
    """The model without causes that are not needed when an effect with a missing covariate replaces a stronger cause.

    A testable effect that looks like an effect with a missing covariate explains only a part of it, and a second effect may
    explain the rest. If the first cause may be the effect with the missing covariate, the second has nothing to explain. The
    same holds if the second may be that effect. The effect with the missing covariate is represented by its proxy. Needed by
    machines of the study of missing columns: tests/diagnosis/test_proxies.py.
    """
    strength = {c: named.log_evidence - without(hypotheses.groups, named, c).log_evidence for c in causes(named)}
    for cause in sorted(strength, key=lambda c: -strength[c]):
        if cause not in named.terms:
            continue
        unrecorded = {m.hypothesis.place for m in class_of(hypotheses, named, cause) if not m.recorded}
        for proxy in [proxy for proxy in hypotheses.proxies if proxy.hypothesis.place in unrecorded]:
            weaker = [c for c in causes(named) if strength[c] < strength[cause]]
            redundant = [
                c
                for c in weaker
                if proxy.hypothesis.place in {m.hypothesis.place for m in class_of(hypotheses, named, c)}
                or _redundant(hypotheses, named, cause, proxy, c)
            ]
            named = hypotheses.only(named, (t for t in named.terms if t not in redundant))
    return named


def _redundant(
    hypotheses: HypothesisSet, named: Posterior[Term], cause: Hypothesis, proxy: Proxy, other: Hypothesis
) -> bool:
    """Whether ``other`` gains less than the prior odds against it when ``proxy`` takes the place of ``cause``."""
    rest = without(hypotheses.groups, named, cause)
    less = without(hypotheses.groups, rest, other)
    with_other = rest.log_evidence + hypotheses.gains(rest, (proxy,))[proxy].value
    alone = less.log_evidence + hypotheses.gains(less, (proxy,))[proxy].value
    return with_other - alone < hypotheses.costs(named.terms)[other]


def with_also(hypotheses: HypothesisSet, found: Conclusion) -> Conclusion:
    """The conclusion that tells apart what is weak and undecided, where other causes are named."""
    small = tuple(
        cause
        for cause, members in found.classes.items()
        if members[0].probability < LIKELY and weak(hypotheses, found.model, cause)
    )
    return replace(found, also=small) if len(small) < len(found.classes) else found


def undecided(hypotheses: HypothesisSet, found: Conclusion) -> tuple[Undecided, ...]:
    """What is weak and undecided, as it is reported."""
    return tuple(Undecided(c.site, size(hypotheses, found.model, c), found.members(c)) for c in found.also)


def weak(hypotheses: HypothesisSet, model: Posterior[Term], cause: Hypothesis) -> bool:
    """Whether a cause explains only a small part of the chi-square beyond noise that the geometry leaves."""
    less = without(hypotheses.groups, model, cause, sweeps=1)
    own = marginal_power(hypotheses.groups, less) - marginal_power(hypotheses.groups, model)
    return own < hypotheses.priors.weak * (hypotheses.groups.power - hypotheses.design.dof)


def size(hypotheses: HypothesisSet, model: Posterior[Term], cause: Hypothesis) -> float:
    """Root mean square of the TCP's displacement by a cause over the poses of the search, m, without the share of its energy
    that the geometry absorbs."""
    groups, at = hypotheses.groups, hypotheses.design.operating_points
    start = sum(model.widths[: model.terms.index(cause)])
    coefficients = model.mean[start : start + groups.width(cause)]
    whole, basis = groups.columns(cause) @ coefficients, cause.basis(at)
    left = float(whole @ groups.marginal.past(whole)) / max(float(whole @ whole), 1e-300)
    moved = basis.displacement(at)[:, :3] @ (basis.sigma * coefficients)
    return float(np.sqrt((moved**2).sum(axis=1).mean() * left))
