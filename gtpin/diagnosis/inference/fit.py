"""The fourth step of a diagnosis: causes and geometry fitted together, what they explain, and doubts that this raises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.hypotheses.lines import strongest_first
from gtpin.diagnosis.inference.causes import cause
from gtpin.diagnosis.inference.descriptions import described, undecided, without_undecided
from gtpin.diagnosis.inference.findings import Cause, Doubt, Question, Undecided, Unexplained
from gtpin.diagnosis.inference.infer import infer
from gtpin.diagnosis.inference.joint_fit import fit_together
from gtpin.diagnosis.inference.predictive import gaps, with_smaller_errors, without_idle
from gtpin.diagnosis.inference.questions import questions, with_possible, without_impossible
from gtpin.diagnosis.inference.settle import SearchState
from gtpin.diagnosis.inference.shown_noise import ShownNoise, Source, floor_of
from gtpin.diagnosis.inference.suspicious_data import (
    hidden_in_scatter,
    with_full_digits,
    with_one_measurement,
    with_two_valued,
)
from gtpin.diagnosis.inference.unexplained import unexplained
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.diagnosis.linear.hold_out import HoldOut, blocks_of, n_sessions
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.preparation.prepare import Prepared
from gtpin.model.model import Model
from gtpin.noise.estimate import LEAST_CONTRASTS


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
    found = described(hypotheses, without_idle(hypotheses, found, neighbours))
    if hypotheses.design.measured.tracked:  # these checks are for poses, not for readings
        found = with_full_digits(found, hypotheses, searched)
        found = with_one_measurement(found, hypotheses, searched)
        found = with_two_valued(hypotheses, found, settled.observed.noise)
    inferred = floor_of(settled.observed.noise, hypotheses.design)
    found = with_smaller_errors(hypotheses, found, neighbours, inferred)
    model, causes = _fitted(prepared, settled, found)
    asked = questions(found, causes, hypotheses.priors)
    impossible = [question for question in asked if not question.believed]
    if impossible and (other := with_possible(hypotheses, found, impossible)):
        other = described(hypotheses, other)  # the next member of a class may be a flexible family
        model, causes = _fitted(prepared, settled, other)
        again = questions(other, causes, hypotheses.priors)
        if all(question.believed for question in again):
            found, asked, impossible = other, again, []
    if impossible:
        other = infer(settled, {(q.effect, q.site) for q in impossible})
        found = without_impossible(hypotheses, found, impossible, {c.place for c in other.sure()})
        model, causes = _fitted(prepared, settled, found)
    shown = ShownNoise.of(settled.observed, hypotheses, settled.guess, prepared.declared, hypotheses.priors)
    floor = shown.floor(hypotheses.design)

    def gaps_by(which: HoldOut) -> tuple[Gap, dict[tuple[str, str], float]]:
        blocks = blocks_of(searched, which, rng)
        whole, takes = gaps(hypotheses, found, floor, blocks, rng, which == "session", inferred)
        return replace(whole, hold_out=which, blocks=len(blocks), sessions=n_sessions(searched)), takes

    checked, takes = gaps_by("region")
    whole, takes = (checked, takes) if hold_out == "region" else gaps_by(hold_out)
    found = without_undecided(hypotheses, found)
    causes = [replace(c, explained_fraction=takes[c.effect, c.site]) for c in causes]
    found = held_out(found, hypotheses, checked, settled.observed, shown)
    at = hypotheses.design.situation
    hidden = hidden_in_scatter(found, _scatter(prepared, settled), hypotheses.untestable, at, hypotheses.priors)
    if hidden:
        found = found.doubted(Doubt("scatter", hidden[0].site))
    remaining = unexplained(hypotheses, found.model, found.verdict == "unknown")
    small = {c.place for c in found.also}
    could_be = tuple(dict.fromkeys((*(h.place for h in hidden), *remaining.could_be)))
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

    Noise is what was declared or what repeated visits show. Nothing can exceed noise that is assumed from the residuals.

    ``whole``: the gap on left-out poses with all causes.
    """
    if found.doubts or shown.source == "residuals":
        return found
    priors, silent = hypotheses.priors, found.verdict == "none"
    if silent and shown.contradicted:
        return found.doubted(Doubt("visits"))
    size, chance = shown.excess(observed, hypotheses, found.model)
    allowed = float(np.sqrt(floor_of(shown.most, hypotheses.design).mean() / shown.floor(hypotheses.design).mean()))
    far = whole.after > (priors.silent if silent else priors.named) * allowed * whole.floor
    if chance <= priors.chance and (far or (silent and size > priors.excess)):
        return found.doubted(Doubt("excess" if shown.visits < LEAST_CONTRASTS else "held_out"))
    return found
