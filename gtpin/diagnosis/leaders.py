"""What comes nearest where something unknown acts: the mechanisms of the catalogue by evidence, and what they leave."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np

from gtpin.diagnosis.evidence import Posterior
from gtpin.diagnosis.gap import Place, leave_out, position_rms
from gtpin.diagnosis.hypothesis import Hypothesis, Term
from gtpin.diagnosis.hypothesis_set import HypothesisSet, causes
from gtpin.diagnosis.result import BestKnown, Gap, Leader
from gtpin.diagnosis.verdict import Conclusion
from gtpin.typing import Floats, Mask

MOST = 5
"""Largest number of leaders."""
TOGETHER = 3
"""Largest number of mechanisms that are added to the named causes for the best that is known. Assumed."""


def leaders(
    hypotheses: HypothesisSet, found: Conclusion, blocks: list[Mask], no_cause: Collection[Place], gap: Gap
) -> tuple[tuple[Leader, ...], BestKnown | None]:
    """The mechanisms that gain most beside the named causes, each with the error that it leaves; and the best set of them.

    The first is there even where it gains less than the prior odds against it. Periodic errors and steps are not among them,
    because several follow any rough error. The error is that of left-out poses, as of the gap: of the geometry with the named
    causes and the mechanism. The best set is None where it explains less than ``Priors.weak`` of the gap's squares beyond
    noise. Smooth terms are in neither: what they explain has no name.

    ``no_cause``: places of effects that are named, or that physics rules out. ``gap``: that of ``found``.
    """

    def left(model: Posterior[Term]) -> float:
        return float(np.sqrt(_squares(hypotheses, model, blocks).mean()))

    free = _mechanisms(hypotheses, no_cause)
    gains = hypotheses.gains(found.model, free)
    every = sorted(gains, key=lambda h: -gains[h].value)
    first = [h for h in every if gains[h].value > hypotheses.cost(h)][:MOST] or every[:1]
    several = tuple(Leader(*h.place, gains[h].value, left(hypotheses.extended(found.model, h))) for h in first)
    model = best_set(hypotheses, found, blocks, no_cause)
    error = left(model) if model is not found.model else gap.after
    explained, whole = gap.before**2 - error**2, gap.before**2 - gap.floor**2
    if not model.terms or explained < hypotheses.priors.weak * whole:
        return several, None
    # Named causes are first in the model.
    return several, BestKnown(tuple(cause.place for cause in causes(model)), error)


def left_with(
    hypotheses: HypothesisSet, found: Conclusion, blocks: list[Mask], places: Iterable[Place]
) -> dict[Place, float | None]:
    """Effects at sites, each with the root mean square position error on left-out poses, m, beside the named causes.

    None where no instrument reads positions, and for an effect that these data can't test: it can't be fitted.
    """
    by_place = {h.place: h for h in hypotheses.named}
    wanted = {place: by_place.get(place) for place in places}
    gains = hypotheses.gains(found.model, [h for h in wanted.values() if h is not None])

    def error(term: Term) -> float | None:
        columns = hypotheses.columns(hypotheses.extended(found.model, term))
        return position_rms(hypotheses.design, leave_out(hypotheses.design, columns, blocks))

    return {place: error(gains[h].term) if h in gains else None for place, h in wanted.items()}


def _mechanisms(hypotheses: HypothesisSet, no_cause: Collection[Place]) -> list[Hypothesis]:
    return [h for h in hypotheses.linear if h.effect.nature == "mechanism" and h.place not in no_cause]


def _squares(hypotheses: HypothesisSet, model: Posterior[Term], blocks: list[Mask]) -> Floats:
    """(N,) squared errors of left-out poses: positions, m^2; of readings, in units of the noise."""
    squares = leave_out(hypotheses.design, hypotheses.columns(model), blocks).errors ** 2
    return np.asarray(squares.sum(axis=1))


def best_set(
    hypotheses: HypothesisSet, found: Conclusion, blocks: list[Mask], no_cause: Collection[Place]
) -> Posterior[Term]:
    """The named causes with the mechanisms that gain most, one after the other.

    Each increases the log posterior, and takes ``Priors.weak`` or more of the squares that the last left of left-out poses.
    """
    model, free = found.model, _mechanisms(hypotheses, no_cause)
    left = float(_squares(hypotheses, model, blocks).mean())
    for _ in range(TOGETHER):
        more = hypotheses.net_gains(model, [h for h in free if h not in model.terms])
        best = max(more, key=lambda h: more[h].value, default=None)
        if best is None or more[best].value <= 0.0:
            break
        larger = hypotheses.extended(model, best)
        now = float(_squares(hypotheses, larger, blocks).mean())
        if now > (1.0 - hypotheses.priors.weak) * left:
            break
        model, left = larger, now
    return model
