"""The class of a cause: every hypothesis, or two together, that could be the cause in its place, with its probability."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import exp, sqrt

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis, SmoothTerm
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, Gain, HypothesisSet, Term, causes, smooth_terms
from gtpin.diagnosis.hypotheses.lines import with_its_lines
from gtpin.diagnosis.inference.findings import Conclusion, Contender, Doubt, FlexibleFamily, Undecided
from gtpin.diagnosis.inference.where import marginal_power
from gtpin.diagnosis.linear.posterior import without
from gtpin.diagnosis.priors import CLASS_SHARE, UNDECIDED


def contenders(
    hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis, unlisted: bool = False
) -> tuple[Contender, ...]:
    """The class of a cause, the most probable member first. Smooth terms share the probability but are not members.

    ``unlisted``: as for :func:`ranked`.
    """
    found = ranked(hypotheses, model, cause, unlisted).named
    least = CLASS_SHARE * found[0].probability
    return tuple(m for m in found if m.probability >= least or m.hypothesis.place == cause.place)


@dataclass(frozen=True)
class Ranking:
    """Everything that could be in the place of a cause, the most probable first.

    ``named``: every hypothesis with its probability. ``smooth``: smooth terms with the probability of each if it were the only
    one. ``heat``: the temperature by which gains in log evidence were divided.
    """

    named: tuple[Contender, ...]
    smooth: tuple[tuple[SmoothTerm, float], ...]
    heat: float


def ranked(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis, unlisted: bool = False) -> Ranking:
    """Everything that could be in the place of a cause, with its probability.

    A hypothesis that only a proxy shows is at most as probable as the most probable one that recorded covariates show.
    ``unlisted``: whether something acts that no effect describes. Then nothing is against the smooth terms that compete.
    Those of the cause's own site and coordinates gain in addition, also beside smooth terms of the model, what an unlisted
    effect departs from a smooth function: as much as a cause departs from its equation.
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
    heat = priors.heat(own)
    found = {h: gain.term if isinstance(gain.term, Hypothesis) else h for h, gain in gains.items()}
    found[mine] = cause
    # Prior odds differ because a hypothesis at the site of a stronger cause may be that cause's departure from its equation.
    costs = {h: sum(hypotheses.costs((*rest.terms, h)).values()) for h in (*gains, mine)}
    # It may be so; where it explains as much as the cause, it stays in the class.
    log = {h: gain.value / heat - min((costs[h] - costs[mine]) / heat, priors.imitation) for h, gain in gains.items()}
    likeliest, by_proxy = max(log.values()), set()
    for proxy, gain in hypotheses.gains(rest, hypotheses.proxies).items():
        value = gain.value / heat + float(np.log(proxy.odds))
        if value > log.get(proxy.hypothesis, -np.inf):
            log[proxy.hypothesis] = min(value, likeliest)
            by_proxy.add(proxy.hypothesis)
    against = hypotheses.gains(rest, unnamed(hypotheses, cause))
    # Several lines can follow any smooth function, so nothing is added for a departure of the cause from its equation.
    # An effect of exactly time, or exactly session, has no form of its own: another part can move with it as well. Both have
    # the same functions and differ in the part that moves, so only the square root of the temperature divides the difference.
    robot = hypotheses.design.operating_points.robot
    clock = cause.clock(robot)
    rigid = [h for h in gains if clock and {h.site, cause.site} == {"frame", "platform"} and h.clock(robot) == clock]
    for h in rigid:
        ahead = (gains[h].value - gains[mine].value) / sqrt(heat)
        log[h] = log[mine] + ahead - hypotheses.cost(h) + hypotheses.cost(mine)
    if clock and cause.site == "frame" and not robot.constraints:  # an arm's base moves as the frame does: one cause
        against = {s: gain for s, gain in against.items() if (s.site, frozenset(s.over)) != (robot.sites[0], clock)}

    unknown = unlisted or bool(smooth_terms(model))

    def against_smooth(term: SmoothTerm) -> float:
        if unknown and term.site == cause.site and set(term.over) <= cause.drivers(robot):
            return -priors.departure * own
        if unlisted:
            return 0.0
        return priors.unnamed + (0.0 if hypotheses.modulates(term, (cause,)) else priors.departure * own)

    smooth = {
        s: log[mine] + (gain.value - gains[mine].value) / sqrt(heat) - priors.same_clock
        if frozenset(s.over) == clock
        else (gain.value - against_smooth(s)) / heat
        for s, gain in against.items()
    }
    top = max([*log.values(), *smooth.values()])  # large numbers would round their sum
    weight = {term: float(np.exp(value - top)) for term, value in (*log.items(), *smooth.items())}
    whole = sum(weight[h] for h in log) + max((weight[term] for term in smooth), default=0.0)
    probability = {h: weight[h] / whole for h in log}
    every = [Contender(found.get(h, h), p, h not in by_proxy) for h, p in probability.items()]
    named = _ordered(every, cause)
    shares = ((term, weight[term] / whole) for term in smooth)
    return Ranking(named, tuple(sorted(shares, key=lambda share: -share[1])), heat)


def _with_lines(
    hypotheses: HypothesisSet, rest: Explanation, gains: Mapping[Hypothesis, Gain], cause: Hypothesis
) -> dict[Hypothesis, Gain]:
    """Gains, with all their lines, of the other periodic errors at a cause's site whose first line exceeds its prior odds."""
    found: dict[Hypothesis, Gain] = {}
    if not hypotheses.long:
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


Classes = Mapping[Hypothesis, tuple[Contender, ...]]
FIRSTS = 4
"""Number of hypotheses that are tried as the first of the two. Assumed: the computing time is proportional to it."""
LEAST_SHARE = 0.5
"""Smallest gain of the first of the two, as a share of the cause's own. Assumed: of two that together explain as much as one
cause, the larger explains at least half of it."""


def with_two_instead(hypotheses: HypothesisSet, model: Explanation, classes: Classes) -> Classes:
    """The classes with two hypotheses in the place of one cause, and of two causes at once, where they are probable enough.

    Two that could together be in the place of one cause have each half of the probability of both, so that the probabilities
    of a class sum to at most 1. Of two others in the place of two causes, each is added to the class of the cause whose place
    it takes, with the probability of both: classes in which one cause is exchanged at a time do not show them.
    For robots without rods, whose models are long, only two of one mechanism are tried, in the place of one cause.
    """
    found = dict(classes)
    for cause, members in classes.items():
        rest = without(hypotheses.groups, model, cause, sweeps=1)
        own = model.log_evidence - rest.log_evidence
        odds, two = _best_two(hypotheses, model, rest, (cause,), LEAST_SHARE * own)
        leader = _own_probability(members, cause)
        whole = 1.0 + odds * leader
        each = odds * leader / whole / 2.0
        if each < CLASS_SHARE * max(m.probability for m in members) / whole:
            continue
        known = {m.hypothesis.place: replace(m, probability=m.probability / whole) for m in members}
        for hypothesis, other in (two, two[::-1]):
            alone = known.get(hypothesis.place, Contender(hypothesis, 0.0, beside=other))
            known[hypothesis.place] = replace(alone, probability=alone.probability + each)
        found[cause] = _ordered(known.values(), cause)
    for pair in combinations(causes(model), 2) if not hypotheses.long else ():
        rest = without(hypotheses.groups, without(hypotheses.groups, model, pair[0]), pair[1], sweeps=1)
        own = model.log_evidence - rest.log_evidence
        odds, two = _best_two(hypotheses, model, rest, pair, LEAST_SHARE * own / 2.0)
        for cause, other in zip(pair, two, strict=False):
            members = found[cause]
            if odds < CLASS_SHARE or any(m.hypothesis.place == other.place for m in members):
                continue
            leader = _own_probability(members, cause)
            whole = 1.0 + odds * leader
            kept = [replace(m, probability=m.probability / whole) for m in members]
            found[cause] = _ordered([*kept, Contender(other, odds * leader / whole)], cause)
    return found


def _own_probability(members: Iterable[Contender], cause: Hypothesis) -> float:
    return next(m.probability for m in members if m.hypothesis.place == cause.place)


def _ordered(members: Iterable[Contender], cause: Hypothesis) -> tuple[Contender, ...]:
    """Members by probability, the largest first; of equal ones the cause."""
    return tuple(sorted(members, key=lambda m: (-m.probability, m.hypothesis.place != cause.place)))


def _best_two(
    hypotheses: HypothesisSet, model: Explanation, rest: Explanation, out: Sequence[Hypothesis], least: float
) -> tuple[float, tuple[Hypothesis, ...]]:
    """The two hypotheses that are most probable in the place of ``out``, and their odds, at most 1, over these; 0 without any.

    ``rest``: the model without ``out``. Neither is one of ``out``, and the first gains at least ``least``, nats.

    Two of another mechanism are tried in addition (the drives of two joints give way): each can be as large as the cause (a
    link bends), and look like it. The prior odds against them are bounded by `imitation`, as those against a single one.
    """
    scanned, places, priors = set(hypotheses.scanned), {h.place for h in out}, hypotheses.priors
    plain = [h for h in hypotheses.named if h not in scanned and h.place not in places]
    gains = hypotheses.gains(rest, plain)
    firsts = sorted((h for h in gains if gains[h].value >= least), key=lambda h: -gains[h].value)
    own = {h.effect for h in out}
    largest = {h.effect: h for h in reversed(firsts) if h.effect.nature == "mechanism" and h.effect not in own}
    tries = [] if hypotheses.long else [(first, plain) for first in firsts[:FIRSTS]]
    tries += [(first, [h for h in plain if h.effect is effect]) for effect, first in largest.items()]
    heat, cost = priors.heat(model.log_evidence - rest.log_evidence), sum(hypotheses.costs(model.terms).values())
    best: tuple[float, tuple[Hypothesis, ...]] = (-np.inf, ())
    for first, seconds in tries:
        one = hypotheses.extended(rest, first)
        more: dict[Hypothesis, Gain] = hypotheses.net_gains(one, [h for h in seconds if h != first])
        if more:
            second = max(more, key=lambda h: more[h].value)
            both = hypotheses.extended(one, second)
            against = (sum(hypotheses.costs(both.terms).values()) - cost) / heat
            alike = first.effect is second.effect and first.effect not in own
            ahead = (both.log_evidence - model.log_evidence) / heat - (
                min(against, priors.imitation) if alike else against
            )
            best = max(best, (ahead, (first, second)), key=lambda pair: pair[0])
    return exp(min(best[0], 0.0)), best[1]


MOST_FORMS = 3
"""Most forms with few parameters that are a mechanism together: a bearing's axis with three error motions. Assumed."""


def described(hypotheses: HypothesisSet, found: Conclusion) -> Conclusion:
    """The conclusion without causes that are only a description: flexible families, which follow any smooth motion.

    Such a family is a cause where forms with few parameters, its own or those of another family, are at least as likely as the
    family and as every smooth term that is not only its modulation, prior odds included. Its class then has the other families
    by their forms, and the cause is the likeliest of them. Otherwise the family says where the error is and over what, but not
    why: it is a doubt where it explains more than a small part of the gap, and no cause. Where its class is undecided it stays.
    """
    told, doubts, mechanisms = [], [], set(found.mechanisms)
    for cause, members in found.classes.items():
        if cause.effect.nature != "description" or members[0].probability < UNDECIDED:
            continue
        by_forms = _by_forms(hypotheses, found.whole(hypotheses), cause)
        if by_forms:
            found, cause = _likeliest_forms(hypotheses, found, cause, by_forms)
            mechanisms.add(cause.place)
        else:
            over = tuple(sorted(cause.drivers(hypotheses.design.operating_points.robot)))
            own = next(m.probability for m in members if m.hypothesis.place == cause.place)
            told.append(FlexibleFamily(*cause.place, over, size(hypotheses, found.model, cause), own))
            if not weak(hypotheses, found.model, cause):
                doubts.append(Doubt("description", cause.site, over))
    found = replace(found, mechanisms=frozenset(mechanisms), descriptions=(*found.descriptions, *told))
    if not told:
        return found
    places = {(d.effect, d.site) for d in told}
    kept = found.only(hypotheses, [cause for cause in found.classes if cause.place not in places])
    return kept.named_beside_unknown(hypotheses).doubted(*doubts) if doubts else kept


def _by_forms(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis) -> dict[Hypothesis, float]:
    """Gain in log evidence, nats, of each flexible family in the place of one by its forms; empty where all gain too little.

    Enough is what the family itself gains and what any smooth term gains, less their prior odds: what they gain beyond forms
    is a motion without a name.
    """
    rest = without(hypotheses.groups, model, cause, sweeps=1)
    own = model.log_evidence - rest.log_evidence
    smooth = max((g.value for g in hypotheses.gains(rest, unnamed(hypotheses, cause)).values()), default=0.0)
    families = [
        h for h in hypotheses.named if h.effect.nature == "description" and (h == cause or h not in model.terms)
    ]
    gains = {family: _gain_of_forms(hypotheses, rest, family) for family in families}
    priors = hypotheses.priors
    least = max((1.0 - priors.modulation) * own, smooth - priors.departure * own) - priors.unnamed
    return gains if max(gains.values()) >= least else {}


def _gain_of_forms(hypotheses: HypothesisSet, rest: Explanation, family: Hypothesis) -> float:
    """Gain of a family's forms: chosen one after the other, each against the prior odds of a choice among all of them.

    The forms become groups of ``hypotheses``, once.
    """
    groups, forms = hypotheses.groups, []
    for number, chosen in enumerate(family.effect.forms(hypotheses.design.operating_points.robot, family.site)):
        form = SmoothTerm(family.site, (str(number),), f"form of {family.effect.id}")
        if form not in groups:
            groups.add(form, groups.columns(family)[:, list(chosen)])
        forms.append(form)
    simple, price = rest, float(np.log(max(len(forms), 1)))
    for _ in range(min(MOST_FORMS, len(forms))):
        gains = hypotheses.gains(simple, forms)
        best = max(gains, key=lambda form: gains[form].value)
        if gains[best].value < price:
            break
        simple = hypotheses.extended(simple, best)
    return simple.log_evidence - rest.log_evidence - (len(simple.terms) - len(rest.terms)) * price


def _likeliest_forms(
    hypotheses: HypothesisSet, found: Conclusion, cause: Hypothesis, by_forms: Mapping[Hypothesis, float]
) -> tuple[Conclusion, Hypothesis]:
    """The conclusion with the families in a cause's class by the gain of their forms; the likeliest of them is the cause."""
    heat = hypotheses.priors.heat(by_forms[cause])
    own = _own_probability(found.classes[cause], cause)
    probability = {m.hypothesis: m.probability for m in found.classes[cause]}
    for family, gain in by_forms.items():
        probability[family] = max(probability.get(family, 0.0), own * exp(min((gain - by_forms[cause]) / heat, 700.0)))
    before = {m.hypothesis: m for m in found.classes[cause]}
    whole = max(sum(probability.values()), 1.0)
    likeliest = max(by_forms, key=lambda family: probability[family])
    members = [replace(before.get(h, Contender(h, 0.0)), probability=p / whole) for h, p in probability.items()]
    least = CLASS_SHARE * max(m.probability for m in members)
    members = [m for m in members if m.probability >= least or m.hypothesis == likeliest]
    terms = [likeliest if term == cause else term for term in found.model.terms]
    model = found.model if likeliest == cause else hypotheses.of(terms, found.model.scale)
    classes = {likeliest if c == cause else c: members_ for c, members_ in found.classes.items()}
    return replace(found, model=model, classes={**classes, likeliest: _ordered(members, likeliest)}), likeliest


def without_undecided(hypotheses: HypothesisSet, found: Conclusion) -> Conclusion:
    """The conclusion that tells apart what is weak and undecided, where other causes are named."""
    small = tuple(
        cause
        for cause, members in found.classes.items()
        if members[0].probability < UNDECIDED and weak(hypotheses, found.model, cause)
    )
    return replace(found, also=small) if len(small) < len(found.classes) else found


def undecided(hypotheses: HypothesisSet, found: Conclusion) -> tuple[Undecided, ...]:
    """What is weak and undecided, as it is reported."""
    return tuple(Undecided(c.site, size(hypotheses, found.model, c), found.members(c)) for c in found.also)


def weak(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis) -> bool:
    """Whether a cause explains only a small part of the chi-square beyond noise that the geometry leaves."""
    less = without(hypotheses.groups, model, cause, sweeps=1)
    own = marginal_power(hypotheses, less) - marginal_power(hypotheses, model)
    return own < hypotheses.priors.weak * (hypotheses.groups.power - hypotheses.design.dof)


def size(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis) -> float:
    """Root mean square of the TCP's displacement by a cause over the poses of the search, m."""
    at = hypotheses.design.operating_points
    start = sum(model.widths[: model.terms.index(cause)])
    basis = cause.basis(at)
    moved = basis.displacement(at)[:, :3] @ (basis.sigma * model.mean[start : start + len(basis)])
    return float(np.sqrt((moved**2).sum(axis=1).mean()))
