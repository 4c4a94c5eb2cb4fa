"""What stands for and against one cause: evidence, rivals, what smooth terms take from it, and the poses that would tell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gtpin.diagnosis.classes import ClassMember, own_probability, ranked, unnamed
from gtpin.diagnosis.discrimination import CauseClass, discriminate
from gtpin.diagnosis.doubts import Context, out_of_range
from gtpin.diagnosis.evidence import NOTHING, Posterior, fixed, without
from gtpin.diagnosis.gap import Place, leave_out, position_rms
from gtpin.diagnosis.hypothesis import Hypothesis, SmoothTerm, Term
from gtpin.diagnosis.hypothesis_set import Gain, HypothesisSet, causes, smooth_of
from gtpin.diagnosis.joint_fit import estimates_in
from gtpin.diagnosis.next_experiment import POSES, fewer
from gtpin.diagnosis.periodic_lines import chance_lines
from gtpin.diagnosis.priors import SURE
from gtpin.diagnosis.result import Experiment, LeftOutErrors, Question, Rival, Standing, Why
from gtpin.diagnosis.trials import Known

RIVALS = 3
"""Number of hypotheses that are listed as rivals, besides the most probable smooth term."""


def why_of(
    place: Place,
    context: Context,
    asked: Sequence[Question],
    known: Known,
    named: Sequence[CauseClass],
    planned: Sequence[Experiment],
    rng: np.random.Generator,
) -> Why:
    """What stands for and against one effect at a site, beside and in the place of the causes of a conclusion.

    ``asked``: parameters of causes that are out of range. ``known``, ``named``, ``rng``: for a planned experiment: what is
    known, the causes with their classes, and random numbers. ``planned``: the experiments of the diagnosis, which are not
    planned again.
    """
    hypotheses, found, groups = context.hypotheses, context.found, context.hypotheses.groups
    for untested in hypotheses.untested:
        if untested.hypothesis.place == place:
            shows = next((e for e in planned if place in e.effects), None)
            by_proxy = (m.probability for c in found.classes.values() for m in c if m.hypothesis.place == place)
            share = max(by_proxy, default=0.0)
            return Why(*place, "untestable", reason=untested.reason, probability=share, experiment=shows)

    # Alone.
    own = next(h for h in hypotheses.named if h.place == place)
    alone = hypotheses.gains(NOTHING, (own,))[own]
    single = hypotheses.extended(NOTHING, alone.term)
    parameters = estimates_in(hypotheses, single, causes(single)[0], context.settled.references)

    # Beside the other causes, and beside smooth terms too.
    mine = next((cause for cause in found.classes if cause.place == place), None)
    rest = found.model if mine is None else without(groups, found.model, mine, sweeps=1)
    gain = hypotheses.gains(rest, (own,))[own]
    needed = gain.value - hypotheses.net_gains(rest, (own,))[own].value
    with_it = hypotheses.extended(rest, gain.term) if mine is None else found.model
    beside = gain.value if mine is None else with_it.log_evidence - rest.log_evidence
    smooth, larger = _smooth_beside(hypotheses, found.beside, rest, own)

    # In the place of the cause whose class has it, else of the cause without which it gains most.
    holders = [c for c, members in found.classes.items() if place in {m.hypothesis.place for m in members}]
    empty = {c: without(groups, found.model, c, sweeps=1) for c in ([mine] if mine else holders or found.classes)}
    in_place = {c: hypotheses.gains(less, (own,))[own].value for c, less in empty.items()}
    out = max(in_place, key=lambda c: in_place[c], default=None)
    less = empty[out] if out else rest
    one = next(cause for cause in causes(with_it) if cause.place == place)
    ranking = ranked(hypotheses, found.model if out else with_it, out or one)
    members = found.classes[out] if out and out in holders else ranking.named
    gains = _gains(hypotheses, members, less)
    if out:  # with all its lines
        gains[out.place] = found.model.log_evidence - less.log_evidence
    others = [m for m in members if m.hypothesis.place != place and m.hypothesis.place in gains]
    others.sort(key=lambda m: (m.hypothesis != out, -m.probability, -gains[m.hypothesis.place]))
    rivals = [Rival(*m.hypothesis.place, (), gains[m.hypothesis.place], m.probability) for m in others[:RIVALS]]
    for best, share in ranking.smooth[:1]:
        rivals.append(Rival("", best.site, best.over, hypotheses.gains(less, (best,))[best].value, share))
    why = Why(
        *place,
        "rival",
        probability=own_probability(members, own),
        log_evidence=alone.value,
        odds=hypotheses.cost(own),
        beside=beside,
        needed=needed,
        smooth=tuple((term.site, term.over) for term in smooth),
        beside_smooth=hypotheses.gains(larger, (own,))[own].value,
        in_place=in_place[out] if out and not mine else beside,
        rivals=tuple(rivals),
        parameters=parameters,
        questions=tuple(out_of_range(own.effect, own.site, parameters, hypotheses.priors)),
        left_out=_left_out(context, [NOTHING, single, rest, with_it]),
    )
    why = replace(why, standing=_standing(context, why, mine, bool(holders), with_it, asked))
    if why.standing == "named" and why.probability >= SURE:
        return why
    if why.standing == "weak":  # anything could be in the place of next to nothing
        why, others = replace(why, rivals=(), in_place=why.beside), []
    pair = [(one, 0.5), *((m.hypothesis, 0.5) for m in others[:1])]  # who asks holds it for possible
    places = {h.place for h, _ in pair}
    for experiment in planned:
        if experiment.kind == "discriminate" and places <= {*experiment.effects}:
            return replace(why, experiment=experiment)
    beside_these = [c for c in named if c.cause.place not in places]
    asks = CauseClass(one, 1.0, tuple(pair), ranking.temperature, priors=hypotheses.priors)
    return replace(why, experiment=discriminate(fewer(known, rng), [asks, *beside_these], 0, POSES, rng))


def _smooth_beside(
    hypotheses: HypothesisSet, needed: Posterior[Term], rest: Posterior[Term], own: Hypothesis
) -> tuple[tuple[SmoothTerm, ...], Posterior[Term]]:
    """The smooth terms that a conclusion needs, else the one that gains most beside ``rest``; and ``rest`` with them."""
    if needed.terms:
        terms, scale = (*rest.terms, *needed.terms), (*rest.scale, *needed.scale)
        return smooth_of(needed), fixed(hypotheses.groups, terms, scale)
    gains = hypotheses.gains(rest, unnamed(hypotheses, own))
    best = max(gains, key=lambda term: gains[term].value, default=None)
    return ((best,), hypotheses.extended(rest, best)) if best else ((), rest)


def _gains(hypotheses: HypothesisSet, members: Iterable[ClassMember], less: Posterior[Term]) -> dict[Place, float]:
    """Gain of members of a class beside the model ``less``, by place; with the proxy where a covariate was not recorded."""
    proxies = {proxy.hypothesis: proxy for proxy in hypotheses.proxies}
    terms = {
        m.hypothesis.place: m.hypothesis.template if m.recorded else proxies.get(m.hypothesis, m.hypothesis.template)
        for m in members
    }
    gains: Mapping[Term, Gain] = hypotheses.gains(less, terms.values())
    return {place: gains[term].value for place, term in terms.items() if term in gains}


def _left_out(context: Context, models: Sequence[Posterior[Term]]) -> LeftOutErrors:
    """Errors on left-out poses of the geometry with each of four models."""
    hypotheses, design = context.hypotheses, context.hypotheses.design
    found = [leave_out(design, hypotheses.columns(model), context.blocks) for model in models]
    sizes = [position_rms(design, one) for one in found]
    if None in sizes:
        return LeftOutErrors("", *(float(np.sqrt((one.errors**2).sum(axis=1).mean())) for one in found))
    return LeftOutErrors("m", *(size for size in sizes if size is not None))


def _standing(
    context: Context,
    why: Why,
    mine: Hypothesis | None,
    held: bool,
    with_it: Posterior[Term],
    asked: Sequence[Question],
) -> Standing:
    """The first reason that applies."""
    hypotheses, found, place = context.hypotheses, context.found, (why.effect, why.site)
    assert why.left_out is not None
    if mine is not None:
        return "also" if mine in found.also else "named"
    if place in {(q.effect, q.site) for q in asked if not q.believed}:
        return "impossible"
    if place in {(family.effect, family.site) for family in found.descriptions}:
        return "description"
    if why.log_evidence < why.odds:
        return "weak"
    if held:
        return "class"
    if why.beside < why.needed:
        return "taken" if why.in_place >= why.needed else "beside"
    if place in {cause.place for cause in chance_lines(hypotheses, with_it)}:
        return "chance"
    if why.smooth and found.beside.terms and why.beside_smooth < why.needed:
        return "smooth"
    if why.left_out.with_it >= why.left_out.without:
        return "left_out"
    return "part" if found.doubts else "rival"
