"""The class of a cause: every hypothesis, or two together, that could be the cause in its place, with its probability."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import exp, log, sqrt

import numpy as np

from gtpin.diagnosis.evidence import Posterior, fixed, without
from gtpin.diagnosis.hypothesis import Hypothesis, SmoothTerm, Term
from gtpin.diagnosis.hypothesis_set import Gain, HypothesisSet, causes, smooth_of
from gtpin.diagnosis.periodic_lines import with_lines
from gtpin.diagnosis.priors import CLASS_SHARE, LIKELY
from gtpin.diagnosis.propose import further_loads
from gtpin.diagnosis.search import LEAST_SHARE, with_two


@dataclass(frozen=True)
class ClassMember:
    """A hypothesis that could be the cause, with its probability.

    ``hypothesis``, ``probability``: the hypothesis, and how probable it is. ``recorded``: false where only a proxy shows it.
    ``beside``: another hypothesis, where only both together could be in the place of the cause.
    """

    hypothesis: Hypothesis
    probability: float
    recorded: bool = True
    beside: Hypothesis | None = None


def class_of(
    hypotheses: HypothesisSet, model: Posterior[Term], cause: Hypothesis, unlisted: bool = False
) -> tuple[ClassMember, ...]:
    """The class of a cause, the most probable member first. Smooth terms share the probability but are not members.

    ``unlisted``: as for :func:`ranked`.
    """
    return ranked(hypotheses, model, cause, unlisted).members(cause)


@dataclass(frozen=True)
class Ranking:
    """Everything that could be in the place of a cause, the most probable first.

    ``named``: every hypothesis with its probability. ``smooth``: smooth terms with the probability of each if it were the only
    one. ``temperature``: the temperature by which gains in log evidence were divided.
    """

    named: tuple[ClassMember, ...]
    smooth: tuple[tuple[SmoothTerm, float], ...]
    temperature: float

    def members(self, cause: Hypothesis) -> tuple[ClassMember, ...]:
        """The class: the cause, and every hypothesis with at least ``CLASS_SHARE`` of the leader's probability."""
        least = CLASS_SHARE * self.named[0].probability
        return tuple(m for m in self.named if m.probability >= least or m.hypothesis.place == cause.place)


def ranked(hypotheses: HypothesisSet, model: Posterior[Term], cause: Hypothesis, unlisted: bool = False) -> Ranking:
    """Everything that could be in the place of a cause, with its probability.

    With the gain g_h in log evidence of each hypothesis h in the place of the cause, and the temperature T,

        p_h = o_h exp(g_h / T) / (sum of o_h exp(g_h / T) over all h, + exp(g_s / T)),

    where o_h are prior odds relative to the cause, between exp(-imitation) and exp(imitation), and g_s is the largest gain of a
    smooth term, less what is against it.

    A hypothesis that only a proxy shows is at most as probable as the most probable one that recorded covariates show.
    ``unlisted``: whether something acts that no effect describes. Then nothing is against the smooth terms that compete.
    """
    rest = without(hypotheses.groups, model, cause, sweeps=1)
    gains = _gains(hypotheses, model, rest, cause)
    mine, priors = cause.template, hypotheses.priors
    temperature = priors.temperature_of(gains[mine].value)

    # Costs differ because a hypothesis at the site of a stronger cause may be that cause's departure from its equation. This
    # may be wrong: the difference is limited to `imitation`, so that what explains as much as the cause stays in the class.
    costs = {h: sum(hypotheses.costs((*rest.terms, h)).values()) for h in gains}
    log_odds = {
        h: gain.value / temperature
        - float(np.clip((costs[h] - costs[mine]) / temperature, -priors.imitation, priors.imitation))
        for h, gain in gains.items()
    }
    likeliest, by_proxy = max(log_odds.values()), set()
    for proxy, gain in hypotheses.gains(rest, hypotheses.proxies).items():
        value = gain.value / temperature + float(np.log(proxy.odds))
        if value > log_odds.get(proxy.hypothesis, -np.inf):
            log_odds[proxy.hypothesis] = min(value, likeliest)
            by_proxy.add(proxy.hypothesis)
    # The frame and the target of one clock have the same functions, as smooth terms of this clock have.
    robot = hypotheses.design.operating_points.robot
    clock = cause.clock(robot)
    for h in gains:
        if clock and {h.site, cause.site} == {"frame", "platform"} and h.clock(robot) == clock:
            ahead = (gains[h].value - gains[mine].value) / sqrt(temperature)
            log_odds[h] = log_odds[mine] + ahead - hypotheses.cost(h) + hypotheses.cost(mine)
    smooth = _smooth_log_odds(
        hypotheses, rest, cause, gains[mine].value, log_odds[mine], unlisted, unlisted or bool(smooth_of(model))
    )

    top = max([*log_odds.values(), *smooth.values()])  # large numbers would round their sum
    weight = {h: float(np.exp(value - top)) for h, value in log_odds.items()}
    of_smooth = {term: float(np.exp(value - top)) for term, value in smooth.items()}
    whole = sum(weight.values()) + max(of_smooth.values(), default=0.0)
    found = {h: gain.term if isinstance(gain.term, Hypothesis) else h for h, gain in gains.items()} | {mine: cause}
    named = [ClassMember(found.get(h, h), w / whole, h not in by_proxy) for h, w in weight.items()]
    shares = sorted(((term, w / whole) for term, w in of_smooth.items()), key=lambda share: -share[1])
    return Ranking(ordered(named, cause), tuple(shares), temperature)


def _gains(
    hypotheses: HypothesisSet, model: Posterior[Term], rest: Posterior[Term], cause: Hypothesis
) -> dict[Hypothesis, Gain]:
    """Gain of each hypothesis in the place of a cause: ``rest`` is the model without it.

    A cause with a period or another nonlinear value counts with its own, its scale and all its lines, and so do the other
    periodic errors at its site whose first line exceeds its prior odds.
    """
    gains, others = hypotheses.gains(rest, hypotheses.named), dict[Hypothesis, Gain]()
    line = hypotheses.priors.line
    for hypothesis, gain in gains.items() if hypotheses.long else ():
        if hypothesis.effect.most_values < 2 or hypothesis.site != cause.site or hypothesis == cause.template:
            continue
        if gain.value > hypotheses.cost(hypothesis) and isinstance(gain.term, Hypothesis):
            larger = with_lines(hypotheses, rest, gain.term)
            term = next(t for t in causes(larger) if t.place == hypothesis.place)
            value = larger.log_evidence - rest.log_evidence - line * len(term.further)
            others[hypothesis] = Gain(max(value, gain.value), term)
    if cause.values or others:
        gained = model.log_evidence - rest.log_evidence - line * len(cause.further)
        gains[cause.template] = Gain(max(gains[cause.template].value, gained), cause)
    return gains | others


def _smooth_log_odds(
    hypotheses: HypothesisSet,
    rest: Posterior[Term],
    cause: Hypothesis,
    gained: float,
    log_odds: float,
    unlisted: bool,
    unknown: bool,
) -> dict[SmoothTerm, float]:
    """Log odds of each smooth term that competes with a cause, whose gain is ``gained``, nats, and whose log odds are given.

    ``unknown``: whether smooth terms are in the model, or something ``unlisted`` acts. Then nothing is against those of the
    cause's own site and coordinates; beside a profile or a description they gain in addition what an unlisted effect departs
    from a smooth function: as much as a cause departs from its equation. A mechanism's equation has fewer coefficients, and
    where it gains more it explains more. Study: examples/planted (a gear's line beside the rough errors of other joints).

    A profile (a track that is not straight, several lines of a drive) follows any function of its own command. It has no
    equation from which a machine could depart, so nothing is added for a departure where a smooth term has other coordinates:
    a drive whose error grows with its load is as good an explanation as a track that is not straight. An effect of exactly
    time, or exactly session, has no equation either: its part can follow a temperature, and another part can move with it.
    It does not depart from any function of its clock, so only the square root of the temperature divides the difference.
    """
    priors, robot = hypotheses.priors, hypotheses.design.operating_points.robot
    temperature, clock = priors.temperature_of(gained), cause.clock(robot)
    nature = cause.effect.nature_of(cause.lines)
    mechanism = nature == "mechanism"
    found = {}
    for term, gain in hypotheses.gains(rest, unnamed(hypotheses, cause)).items():
        same_clock = frozenset(term.over) == clock
        if same_clock and cause.site == "frame" and not robot.constraints and term.site == robot.sites[0]:
            continue  # an arm's base moves as the frame does: one cause
        if same_clock or (clock and not unlisted):
            against = priors.same_clock if same_clock else priors.unnamed
            found[term] = log_odds + (gain.value - gained) / sqrt(temperature) - against
            continue
        departure = priors.departure * max(gained, 0.0)
        if unknown and term.site == cause.site and set(term.over) <= cause.drivers(robot):
            against = 0.0 if mechanism else -departure
        elif unlisted:
            against = 0.0
        else:
            other = not mechanism and set(term.over) != cause.coordinates(robot)
            against = priors.unnamed + (0.0 if other or hypotheses.modulates(term, (cause,)) else departure)
        found[term] = (gain.value - against) / temperature
    return found


def unnamed(hypotheses: HypothesisSet, cause: Hypothesis) -> list[SmoothTerm]:
    """Smooth terms that compete with a cause: those that are not only a modulation of it.

    For a cause with several lines, which can follow any smooth function: also not those that are only a modulation of another
    effect at the same drive, because that effect competes itself.
    """
    known: tuple[Hypothesis, ...] = (cause,)
    if cause.further:
        known = tuple(h for h in hypotheses.linear if h.site == cause.site)
    return [s for s in hypotheses.smooth if not hypotheses.modulates(s, known)]


Classes = Mapping[Hypothesis, tuple[ClassMember, ...]]
FIRSTS = 4
"""Number of hypotheses that are tried as the first of the two. Assumed: the computing time is proportional to it."""
MOST_ODDS = 30.0
"""Largest logarithm of odds that is computed."""


def with_two_instead(hypotheses: HypothesisSet, model: Posterior[Term], classes: Classes) -> Classes:
    """The classes with two hypotheses in the place of one cause, and of two causes at once, where they are probable enough.

    Two that could together be in the place of one cause have each half of the probability of both, so that the probabilities
    of a class sum to at most 1. Of two others in the place of two causes, each is added to the class of the cause whose place
    it takes, with the probability of both: classes in which one cause is exchanged at a time do not show them. Needed by pairs
    of causes of the simulator, beside which a third effect was certain without this rule.
    For robots without rods, whose models are long, only two of one mechanism are tried, in the place of one cause.
    """
    found = dict(classes)
    for cause, members in classes.items():
        rest = without(hypotheses.groups, model, cause, sweeps=1)
        own = model.log_evidence - rest.log_evidence
        odds, two = _best_two(hypotheses, model, rest, (cause,), LEAST_SHARE * own)
        found[cause] = _or_together(members, cause, two, odds)
    for pair in combinations(causes(model), 2) if not hypotheses.long else ():
        rest = without(hypotheses.groups, without(hypotheses.groups, model, pair[0]), pair[1], sweeps=1)
        own = model.log_evidence - rest.log_evidence
        odds, two = _best_two(hypotheses, model, rest, pair, LEAST_SHARE * own / 2.0)
        for cause, other in zip(pair, two, strict=False):
            members = found[cause]
            if odds < CLASS_SHARE or any(m.hypothesis.place == other.place for m in members):
                continue
            leader = own_probability(members, cause)
            whole = 1.0 + odds * leader
            kept = [replace(m, probability=m.probability / whole) for m in members]
            found[cause] = ordered([*kept, ClassMember(other, odds * leader / whole)], cause)
    return found


def _or_together(
    members: tuple[ClassMember, ...],
    cause: Hypothesis,
    several: Sequence[Hypothesis],
    odds: float,
    recorded: bool = True,
) -> tuple[ClassMember, ...]:
    """A cause's class in which several hypotheses that act together may be in the place of the cause.

    ``odds``: those of all together to the cause. ``recorded``: false where they lack a column. Their probability is divided
    equally between them. Where each has less than ``CLASS_SHARE`` of the largest probability, the class stays as it is.
    """
    if not several:
        return members
    leader = own_probability(members, cause)
    whole = 1.0 + odds * leader
    each = odds * leader / whole / len(several)
    known = {m.hypothesis.place: replace(m, probability=m.probability / whole) for m in members}
    if each < CLASS_SHARE * max(m.probability for m in known.values()):
        return members
    for hypothesis, other in zip(several, (*several[1:], several[0]), strict=True):
        beside = None if other == hypothesis else other
        alone = known.get(hypothesis.place, ClassMember(hypothesis, 0.0, recorded, beside))
        known[hypothesis.place] = replace(
            alone, probability=alone.probability + each, beside=beside if each > alone.probability else alone.beside
        )
    return ordered(known.values(), cause)


def with_shared_loads(hypotheses: HypothesisSet, model: Posterior[Term], classes: Classes) -> Classes:
    """The classes in which another mechanism may share the load of a cause: a column bends on a base that rocks.

    It is one at the cause's site under the same load. The parts of a chain without rods carry their loads in series: one at
    another site counts too, of those that gain most beside the cause or in its place, where it gains more than its prior odds
    as the only cause, or where both together explain more than the cause alone. With it the cause can have another size.

    Both together are compared with the cause alone, and the more favourable of two comparisons counts:

    - With the second of the size that gains most. No machine follows an equation exactly, so this gain may be the first's
      departure; the prior odds against the second are bounded by `imitation`, as in the class of the cause.
    - With the second of the size that it would have in the place of the cause. Where the data leave open how much each does,
      little is lost. What is lost is Occam's factor, which does not grow with the evidence: the temperature is the smallest.

    The probability of both together is divided equally between them. A cause whose probability, alone and with the other, is
    0.5 or more keeps 0.5. Studies: tests/diagnosis/test_telescope.py, tests/diagnosis/test_two_in_series.py,
    tests/diagnosis/test_base_and_drive.py.
    """
    found, priors = dict(classes), hypotheses.priors
    for cause, members in classes.items():
        soft = [h for h in hypotheses.linear if cause.effect.load and h.effect.load and h not in model.terms]
        here = [h for h in soft if h.site == cause.site and h.effect.load == cause.effect.load]
        there = [h for h in soft if h not in here and not _in_all_links(h, cause)] if hypotheses.long else []
        rest = without(hypotheses.groups, model, cause, sweeps=1)
        temperature = priors.temperature_of(model.log_evidence - rest.log_evidence)
        beside, alone = hypotheses.gains(model, soft), hypotheses.gains(rest, there)
        largest = [max(there, key=lambda h: gains[h].value) for gains in (beside, alone) if there]
        for other in dict.fromkeys((*here, *largest)):
            gain, both = beside[other].value, (*model.terms, other)
            against = sum(hypotheses.costs(both).values()) - sum(hypotheses.costs(model.terms).values())
            instead = hypotheses.extended(rest, other).scale[-1]
            shared = fixed(hypotheses.groups, both, (*model.scale, instead)).log_evidence - model.log_evidence
            if other in there and gain < hypotheses.cost(other) and shared < 0.0:
                continue
            first = gain / temperature - min(against / temperature, priors.imitation)
            ahead = max(first, min(shared, 0.0) / priors.temperature)
            shares = _or_together(members, cause, (cause, other), exp(min(ahead, MOST_ODDS)))
            if shares is members:
                continue
            known = {m.hypothesis.place: m for m in shares}
            own, second = known[cause.place], known[other.place]
            lacking = max(min(LIKELY - own.probability, second.probability), 0.0)
            known[cause.place] = replace(own, probability=own.probability + lacking, beside=None)
            known[other.place] = replace(second, probability=second.probability - lacking)
            found[cause] = members = ordered(known.values(), cause)
    return found


def _in_all_links(one: Hypothesis, other: Hypothesis) -> bool:
    """Whether two hypotheses are one effect, of all links and of one of these: a link that gives way by more is a departure."""
    return one.effect is other.effect and "arm" in (one.site, other.site)


def with_all_actuators(hypotheses: HypothesisSet, model: Posterior[Term], classes: Classes) -> Classes:
    """The classes in which one mechanism at all actuators may be in the place of a cause at all links.

    Belts that stretch at every cart look like links that all stretch. Both are one cause at many parts of one build, so that
    their prior odds are equal. Mechanisms are tried whose gains at the actuators sum to ``LEAST_SHARE`` of the cause's own or
    more; the probability of the best is divided equally between the actuators. Not for robots without rods.
    Study: tests/diagnosis/test_light_machines.py.
    """
    found = dict(classes)
    mechanisms = {h.effect: None for h in hypotheses.linear if h.effect.nature == "mechanism"}
    for cause, members in classes.items() if not hypotheses.long else ():
        rest, best = without(hypotheses.groups, model, cause, sweeps=1), (0.0, tuple[Hypothesis, ...]())
        own = model.log_evidence - rest.log_evidence
        for effect in mechanisms if cause.site == "arm" else ():
            sites = hypotheses.design.operating_points.robot.sites
            alike = [h for h in hypotheses.linear if h.effect is effect and h.site in sites and h not in model.terms]
            gains = hypotheses.gains(rest, alike)
            if len(alike) > 1 and sum(gain.value for gain in gains.values()) >= LEAST_SHARE * own:
                every = hypotheses.of((*rest.terms, *alike), (*rest.scale, *(1.0 for _ in alike)))
                ahead = (every.log_evidence - model.log_evidence) / hypotheses.priors.temperature_of(own)
                best = max(best, (exp(min(ahead, 0.0)), tuple(alike)), key=lambda one: one[0])
        odds, several = best
        found[cause] = _or_together(members, cause, several, odds)
    return found


def with_equal_actuators(hypotheses: HypothesisSet, model: Posterior[Term], classes: Classes) -> Classes:
    """The classes in which an effect that all actuators have alike may be in the place of a cause of the frame.

    Drives that all lag by one time look like readings that are late by it, and drives of one wrong scale like an instrument of
    this scale. Both have one parameter, so that their prior odds are equal. The probability is divided equally between the
    actuators. Studies: tests/diagnosis/test_late_readings.py, tests/diagnosis/test_diagnosis_verdict.py.
    """
    found, groups = dict(classes), hypotheses.groups
    for cause in classes:
        for effect in {h.effect: None for h in hypotheses.linear if h.effect.alike and cause.site == "frame"}:
            every = [h for h in hypotheses.linear if h.effect is effect]
            equal = SmoothTerm("frame", (effect.id,), "equal at all actuators")
            if equal not in groups:
                groups.add(equal, np.sum([groups.columns(h)[:, list(effect.core)] for h in every], axis=0))
            rest = without(groups, model, cause, sweeps=1)
            own = model.log_evidence - rest.log_evidence
            ahead = (hypotheses.gains(rest, [equal])[equal].value - own) / hypotheses.priors.temperature_of(own)
            if len(every) > 1:
                found[cause] = _or_together(found[cause], cause, every, exp(min(ahead, 0.0)))
    return found


def with_further_load(hypotheses: HypothesisSet, model: Posterior[Term], classes: Classes) -> Classes:
    """The classes in which a load that was not recorded may be in the place of causes over time or session alone.

    What gives way under the recorded loads gives way under a further one. Where it hangs on or is taken off, all drives shift
    at once, each by its own compliance. So the mechanisms of the model that give way under loads have one displacement for a
    further payload in each of some intervals of time, at the mean of their coefficients. It is tried in the place of each such
    cause, and of all. The probability is divided equally between the mechanisms. Study: tests/diagnosis/test_further_load.py.
    """
    design, groups, priors = hypotheses.design, hypotheses.groups, hypotheses.priors
    soft = [cause for cause in causes(model) if cause.effect.load]
    timed = [cause for cause in classes if cause.clock(design.operating_points.robot)]
    situations = further_loads(design.operating_points, priors) if soft and timed else []
    if not situations:
        return classes
    ends = np.cumsum((0, *model.widths))
    mean = {term: model.mean[a:b] for term, a, b in zip(model.terms, ends[:-1], ends[1:], strict=True)}
    moved = [sum((design.columns(c.basis(at)) - groups.columns(c)) @ mean[c] for c in soft) for at in situations]
    load = SmoothTerm("platform", (str(hash((model.terms, model.scale))),), "further load")
    if load not in groups:
        groups.add(load, np.stack(moved, axis=1))
    found = dict(classes)
    for out in [[cause] for cause in timed] + [timed] * (len(timed) > 1):
        rest = model
        for cause in out:
            rest = without(groups, rest, cause, sweeps=1)
        own = model.log_evidence - rest.log_evidence
        cost = sum(hypotheses.costs(model.terms).values()) - sum(hypotheses.costs(rest.terms).values())
        ahead = hypotheses.gains(rest, [load])[load].value - own + cost - hypotheses.threshold + log(priors.not_varied)
        odds = exp(min(ahead / priors.temperature_of(own), 0.0))
        found |= {cause: _or_together(found[cause], cause, soft, odds, recorded=False) for cause in out}
    return found


def own_probability(members: Iterable[ClassMember], cause: Hypothesis) -> float:
    """The probability of a cause itself in its class."""
    return next(m.probability for m in members if m.hypothesis.place == cause.place)


def ordered(members: Iterable[ClassMember], cause: Hypothesis) -> tuple[ClassMember, ...]:
    """Members by probability, the largest first; of equal ones the cause."""
    return tuple(sorted(members, key=lambda m: (-m.probability, m.hypothesis.place != cause.place)))


def _best_two(
    hypotheses: HypothesisSet, model: Posterior[Term], rest: Posterior[Term], out: Sequence[Hypothesis], least: float
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
    temperature = priors.temperature_of(model.log_evidence - rest.log_evidence)
    cost = sum(hypotheses.costs(model.terms).values())
    best: tuple[float, tuple[Hypothesis, ...]] = (-np.inf, ())
    for first, seconds in tries:
        both = with_two(hypotheses, rest, first, seconds)
        second = causes(both)[-1]
        if second != first:
            against = (sum(hypotheses.costs(both.terms).values()) - cost) / temperature
            alike = first.effect is second.effect and first.effect not in own
            ahead = (both.log_evidence - model.log_evidence) / temperature - (
                min(against, priors.imitation) if alike else against
            )
            best = max(best, (ahead, (first, second)), key=lambda pair: pair[0])
    return exp(min(best[0], 0.0)), best[1]
