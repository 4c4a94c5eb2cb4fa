"""The fourth step of a diagnosis: causes and geometry fitted together, what they explain, and doubts that this raises."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.hypotheses.lines import strongest_first
from gtpin.diagnosis.inference.classes import contenders, described, undecided, without_undecided
from gtpin.diagnosis.inference.findings import Cause, Conclusion, Doubt, Question, Undecided, Unexplained
from gtpin.diagnosis.inference.infer import infer
from gtpin.diagnosis.inference.joint_fit import fit_together
from gtpin.diagnosis.inference.predictive import gaps, lost, with_smaller_errors, without_certainty
from gtpin.diagnosis.inference.settle import SearchState
from gtpin.diagnosis.inference.shown_noise import ShownNoise, Source, floor_of
from gtpin.diagnosis.inference.suspicious_data import (
    hidden_in_scatter,
    with_full_digits,
    with_one_measurement,
    with_two_valued,
)
from gtpin.diagnosis.inference.where import unexplained
from gtpin.diagnosis.linear.cross_validation import Gap, HoldOut, blocks_of, n_sessions
from gtpin.diagnosis.linear.design import Observed
from gtpin.diagnosis.prepare import Prepared
from gtpin.diagnosis.priors import Priors
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import References
from gtpin.errors import ConvergenceError
from gtpin.estimate import Estimate
from gtpin.model.model import Model
from gtpin.noise.estimate import LEAST_CONTRASTS
from gtpin.robot.chain import Chain


@dataclass(frozen=True)
class Fitted:
    """The final conclusion, with the fitted causes.

    ``conclusion``: the conclusion, with the doubts that the fit and left-out poses raise. ``model``: the geometry and the
    causes, fitted together. ``causes``: the one that explains most of the gap is the first. ``also``: what is weak and
    undecided beside them. ``gap``: errors on left-out poses, without and with the causes. ``unexplained``: what the causes do
    not explain. ``questions``: parameters whose values are not plausible or not usual. ``noise_source``: where the noise floor
    comes from.
    """

    conclusion: Conclusion
    model: Model
    causes: tuple[Cause, ...]
    also: tuple[Undecided, ...]
    gap: Gap
    unexplained: Unexplained
    questions: tuple[Question, ...]
    noise_source: Source


def fit(
    prepared: Prepared, settled: SearchState, found: Conclusion, rng: np.random.Generator, hold_out: HoldOut = "region"
) -> Fitted:
    """Fit geometry and causes together, and check the parameters against their plausible ranges and the fit on left-out poses.

    The checks always leave out neighbouring poses; ``hold_out`` says what is left out for the gap that is reported.
    """
    hypotheses, searched = settled.hypotheses, settled.searched
    neighbours = blocks_of(searched, "region", rng)
    found = described(hypotheses, found)
    if hypotheses.design.measured.tracked:  # these checks are for poses, not for readings
        found = with_full_digits(found, hypotheses, searched)
        found = with_one_measurement(found, hypotheses, searched)
        found = with_two_valued(hypotheses, found, settled.observed.noise)
    inferred = floor_of(settled.observed.noise, hypotheses.design)
    found = with_smaller_errors(hypotheses, found, neighbours)
    try:
        model, causes = _fitted(prepared, settled, found)
    except ConvergenceError:  # the causes explain the data to first order only: no closed chain has them at such sizes
        if not found.classes:
            raise
        found = found.only(hypotheses, []).doubted(Doubt("held_out"))
        model, causes = _fitted(prepared, settled, found)
    asked = questions(found, causes, hypotheses.priors)
    impossible = [question for question in asked if not question.believed]
    if impossible:
        other = infer(settled, {(q.effect, q.site) for q in impossible})
        found = without_impossible(hypotheses, found, impossible, {c.place for c in other.sure()})
        model, causes = _fitted(prepared, settled, found)
    shown = ShownNoise.of(settled.observed, hypotheses, settled.guess, prepared.declared, hypotheses.priors)
    floor = shown.floor(hypotheses.design)

    def gaps_by(which: HoldOut) -> tuple[Gap, dict[tuple[str, str], Gap]]:
        blocks = blocks_of(searched, which, rng)
        whole, less = gaps(hypotheses, found, floor, blocks, rng, which == "session", inferred)
        return replace(whole, hold_out=which, blocks=len(blocks), sessions=n_sessions(searched)), less

    checked, less = gaps_by("region")
    found = without_undecided(hypotheses, without_certainty(found, checked, less))
    before, found = found, held_out(found, hypotheses, checked, settled.observed, shown)
    at = hypotheses.design.operating_points
    untestable = [one.hypothesis for one in hypotheses.untested]
    hidden = hidden_in_scatter(found, _scatter(prepared, settled), untestable, at, hypotheses.priors)
    if hidden:
        found = found.doubted(Doubt("scatter", hidden[0].site))
    sure = found.named_beside_unknown(hypotheses) if found.doubts else found
    if len(sure.classes) < len(found.classes) or found.classes is not before.classes:
        # A cause that is not sure may only take up a part of the unknown.
        found = sure
        model, causes = _fitted(prepared, settled, found)
        checked, less = gaps_by("region")
    whole, less = (checked, less) if hold_out == "region" else gaps_by(hold_out)
    causes = [replace(c, explained_fraction=lost(whole, less[c.effect, c.site])) for c in causes]
    remaining = unexplained(hypotheses, found.model, found.verdict == "unknown")
    small = {c.place for c in found.also}
    no_cause = {c.place for c in found.classes} | {(q.effect, q.site) for q in impossible}
    likely = (place for place in found.likely if place not in no_cause)
    could_be = tuple(dict.fromkeys((*likely, *(h.place for h in hidden), *remaining.could_be)))
    return Fitted(
        conclusion=found,
        model=model,
        causes=tuple(
            sorted((c for c in causes if (c.effect, c.site) not in small), key=lambda c: -c.explained_fraction)
        ),
        also=undecided(hypotheses, found),
        gap=whole,
        unexplained=replace(remaining, could_be=could_be, descriptions=found.descriptions),
        questions=tuple(asked),
        noise_source=shown.source,
    )


def _scatter(prepared: Prepared, settled: SearchState) -> float:
    """Scatter of the drives over the instrument's noise: from repeated visits for poses, from all residuals for readings."""
    visits, noise = prepared.baseline.noise, settled.observed.noise
    if settled.observed.measured.tracked:
        return visits.repeatability / visits.position_sigma
    moved = np.sqrt((settled.hypotheses.design.by_command_seen**2).sum(axis=2))
    return float(np.median(noise.repeatability * moved / noise.each))


def _fitted(prepared: Prepared, settled: SearchState, found: Conclusion) -> tuple[Model, list[Cause]]:
    """The model fitted with the causes, and the causes with their parameters."""
    named: Sequence[Hypothesis] = list(found.classes)
    scale = [
        found.scale[hypothesis] for hypothesis in named
    ]  # not `cause` as the variable: in Python 3.12.1 the function `cause` would then be unbound below
    ordered = [strongest_first(settled.hypotheses, found.model, c) for c in named]
    model = fit_together(settled.everything, prepared.baseline.model, ordered, scale, settled.references)
    return model, [cause(model, own, found, c, settled.hypotheses) for c, own in zip(named, ordered, strict=True)]


def held_out(
    found: Conclusion, hypotheses: HypothesisSet, whole: Gap, observed: Observed, shown: ShownNoise
) -> Conclusion:
    """The conclusion, with a doubt where residuals and errors on left-out poses are larger than noise.

    Beside causes, the errors may exceed noise by a small share of the gap, since no cause follows its equation exactly: of
    the gap of positions on left-out poses, or of all that was measured, in units of noise. A wrist rotates the tool and hardly
    shifts it.

    Noise is what was declared or what repeated visits show. Nothing can exceed noise that is assumed from the residuals.
    Without causes the repeatability is the largest that the visits allow; beside causes it is the likeliest, else what the
    causes do not explain would pass for it.

    ``whole``: the gap on left-out poses with all causes.
    """
    if found.doubts or shown.source == "residuals":
        return found
    priors, silent = hypotheses.priors, found.verdict == "none"
    if silent and shown.contradicted:
        return found.doubted(Doubt("visits"))
    noise = shown.most if silent else shown.noise
    size, chance, part = shown.excess(noise, observed, hypotheses, found.model)
    allowed = float(floor_of(noise, hypotheses.design).mean() / shown.floor(hypotheses.design).mean())
    before, after, floor = whole.before**2, whole.after**2, allowed * whole.floor**2
    far = after > priors.silent**2 * floor
    if not silent:
        far = after - floor > priors.core_leaves * (before - floor)
        far &= shown.share_left(observed, hypotheses, found.model) > priors.core_leaves
    if chance <= priors.chance and (far or (silent and size > priors.excess)):
        # Something acts that no effect describes: a smooth term may as well be in the place of a certain cause.
        model = found.whole(hypotheses)
        again = {cause: contenders(hypotheses, model, cause, unlisted=True) for cause in found.sure()}
        doubt = Doubt("part", part) if part else Doubt("excess" if shown.visits < LEAST_CONTRASTS else "held_out")
        return replace(found, classes={**found.classes, **again}).doubted(doubt)
    return found


DRAWS = 150
"""Number of draws from a posterior for a parameter's sigma; as many mirrored draws are added."""
WITHIN = 0.6827
"""Share of the draws that differ from the value by less than sigma: as of a normal distribution."""


def cause(
    model: Model, hypothesis: Hypothesis, found: Conclusion, named: Hypothesis, hypotheses: HypothesisSet
) -> Cause:
    """A cause ``named`` in a conclusion, with its parameters from the fitted model. Its ``explained_fraction`` is 0 at first.

    The others of its class have the parameters of a linear fit in its place.
    """
    active = next(e for e in model.effects if (e.effect.id, e.site) == hypothesis.place)
    own = next(m for m in found.classes[named] if m.hypothesis.place == hypothesis.place)
    parameters = estimates(model.robot, active, hypothesis)
    members = []
    for contender, member in zip(found.classes[named], found.members(named), strict=True):
        other, told = contender.hypothesis, parameters
        if other.place != hypothesis.place:
            alone = contender.recorded and contender.beside is None
            taken = alone and _in_its_place(hypotheses, found, named, other, active.references)
            told = estimates(model.robot, taken, other) if taken else {}
        members.append(replace(member, parameters=told))
    return Cause(*hypothesis.place, own.probability, tuple(members), parameters, 0.0, found.nature(hypothesis))


def _in_its_place(
    hypotheses: HypothesisSet, found: Conclusion, named: Hypothesis, other: Hypothesis, references: References
) -> ActiveEffect | None:
    """Another member of a cause's class in its place, by a linear fit; None where it is a cause itself."""
    terms = found.model.terms
    if other.place in {term.place for term in terms if isinstance(term, Hypothesis)}:
        return None
    model = hypotheses.of([other if term == named else term for term in terms], found.model.scale)
    start, sigma = sum(model.widths[: terms.index(named)]), other.basis(hypotheses.design.operating_points).sigma
    own = slice(start, start + len(sigma))
    covariance = model.covariance[own, own] * np.outer(sigma, sigma)
    return ActiveEffect(
        other.effect, other.site, other.shape_parameter, model.mean[own] * sigma, covariance, references, other.further
    )


def estimates(robot: Chain, active: ActiveEffect, hypothesis: Hypothesis) -> dict[str, Estimate]:
    """Parameters by name: value at the coefficients' posterior mean, and sigma, within which 68 % of draws lie about it.

    Draws from the posterior are needed because some parameters, such as a curve's root mean square, are not linear in the
    coefficients. They are not needed for the value: a mean or a median of draws of such a norm is too large, because the
    draws add the posterior's variance to coefficients that contain the noise already.
    """
    least = [active.effect.least_sigma(robot, active.site, active.references, value) for value in active.values]
    sigmas = [max(sigma, one) for (_, sigma), one in zip(hypothesis.lines, least, strict=True)]
    values, vectors = np.linalg.eigh(active.covariance)
    unit = np.random.default_rng(0).standard_normal((DRAWS, len(values) + max(len(active.values), 1)))
    drawn = []
    for z in np.vstack([unit, -unit]):
        c = active.coefficients + vectors @ (np.sqrt(np.maximum(values, 0.0)) * z[: len(values)])
        own = zip(active.values, sigmas, z[len(values) :], strict=False)
        places = [value + sigma * float(draw) for value, sigma, draw in own]
        drawn.append([v for v, _ in active.effect.parameters_of(robot, active.site, c, places).values()])
    said = active.effect.parameters_of(robot, active.site, active.coefficients, active.values)
    sigma = np.quantile(np.abs(np.array(drawn) - [value for value, _ in said.values()]), WITHIN, axis=0)
    return {name: Estimate(value, float(s), unit) for (name, (value, unit)), s in zip(said.items(), sigma, strict=True)}


def questions(found: Conclusion, causes: Iterable[Cause], priors: Priors) -> list[Question]:
    """Compare parameters of causes with the ranges that their effects state as plausible and usual.

    A cause with an impossible parameter is not named; with an unusual one it is (``believed``). The impossible ones come first.
    """
    effects, asked = {hypothesis.place: hypothesis.effect for hypothesis in found.classes}, list[Question]()
    for cause in causes:
        effect = effects[cause.effect, cause.site]
        for ranges, believed in ((effect.plausible, False), (effect.expected_range, True)):
            before = len(asked)
            for name, own in ranges.items():
                if name not in cause.parameters:
                    continue
                e = cause.parameters[name]
                reach = priors.implausible * e.sigma
                if not (own.low <= e.value + reach and e.value - reach <= own.high):
                    place = cause.effect, cause.site, name
                    asked.append(Question(*place, e.value, e.sigma, e.unit, own.low, own.high, own.why, believed))
            if len(asked) > before:
                break
    return sorted(asked, key=lambda question: question.believed)


def without_impossible(
    hypotheses: HypothesisSet, found: Conclusion, asked: Sequence[Question], sure: Collection[tuple[str, str]]
) -> Conclusion:
    """The conclusion without impossible causes, with a doubt: an unknown cause looks like them.

    ``sure``: effects and sites that a search without the impossible causes names with confidence. Other causes are not named:
    they may explain the data only together with an impossible one.
    """
    places = {(q.effect, q.site) for q in asked}
    wrong = next(cause for cause in found.classes if cause.place == (asked[0].effect, asked[0].site))
    over = tuple(sorted(wrong.drivers(hypotheses.design.operating_points.robot)))
    kept = found.only(hypotheses, [cause for cause in found.classes if cause.place in {*sure} - places])
    return kept.doubted(Doubt("impossible", wrong.site, over))
