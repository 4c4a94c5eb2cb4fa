"""Causes whose parameters no machine can have, or few have: what is reported as a question."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from gtpin.diagnosis.hypotheses.hypothesis import Free
from gtpin.diagnosis.hypotheses.hypothesis_set import Pool
from gtpin.diagnosis.inference.decide import Decision
from gtpin.diagnosis.result import Cause, Question
from gtpin.effects.effect import Range

DOUBT = 3.0
"""Standard deviations by which a parameter must lie outside a range: a chance of 1.3 in 1,000."""


@dataclass(frozen=True)
class Questioned:
    """What was asked of causes: ``impossible`` are not believed, of ``unusual`` ones the user is told."""

    impossible: tuple[Question, ...]
    unusual: tuple[Question, ...]


def questions(pool: Pool, causes: Iterable[Cause]) -> Questioned:
    """Compare parameters of causes with what their effects call plausible and usual."""
    impossible, unusual = [], []
    for cause in causes:
        effect = pool.candidates[f"{cause.effect}@{cause.site}"].effect
        found = [q for name, own in effect.plausible.items() if (q := _outside(cause, name, own, False))]
        impossible += found
        if not found:
            unusual += [q for name, own in effect.usual.items() if (q := _outside(cause, name, own, True))]
    return Questioned(tuple(impossible), tuple(unusual))


def without_impossible(pool: Pool, found: Decision, asked: Sequence[Question]) -> Decision:
    """The verdict without causes that can't be: something is there, but it is not what it looks like."""
    doubted = {f"{q.effect}@{q.site}" for q in asked}
    kept = [n for n in found.named.names if n not in doubted]
    first = asked[0]
    over = tuple(sorted(pool.explanation(f"{first.effect}@{first.site}").drivers(pool.design.situation.robot)))
    return replace(
        found,
        verdict="unknown",
        named=pool.only(found.named, kept),
        classes={n: found.classes[n] for n in kept},
        strangers=(*found.strangers, Free(first.site, over, "impossible")),
        unknown=1.0,
    )


def _outside(cause: Cause, name: str, own: Range, believed: bool) -> Question | None:
    if name not in cause.parameters:
        return None
    found = cause.parameters[name]
    value, sigma, unit = found.value, found.sigma, found.unit
    if own.low <= value + DOUBT * sigma and value - DOUBT * sigma <= own.high:
        return None
    return Question(cause.effect, cause.site, name, value, sigma, unit, own.low, own.high, own.why, believed)
