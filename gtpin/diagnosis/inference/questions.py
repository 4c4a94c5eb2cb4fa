"""Questions: parameters of causes with values that are impossible or unusual."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.findings import Cause, Doubt, Question
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.exchange import without
from gtpin.diagnosis.priors import Priors
from gtpin.effects.effect import Range


@dataclass(frozen=True)
class Questioned:
    """Questions about parameters of causes. A cause with an impossible parameter is not named; with an unusual one it is."""

    impossible: tuple[Question, ...]
    unusual: tuple[Question, ...]


def questions(found: Conclusion, causes: Iterable[Cause], priors: Priors) -> Questioned:
    """Compare parameters of causes with the ranges that their effects state as plausible and usual."""
    effects = {hypothesis.place: hypothesis.effect for hypothesis in found.classes}
    impossible, unusual = [], []
    for cause in causes:
        effect = effects[cause.effect, cause.site]
        wrong = [q for name, own in effect.plausible.items() if (q := _outside(cause, name, own, False, priors))]
        impossible += wrong
        if not wrong:
            unusual += [q for name, own in effect.usual.items() if (q := _outside(cause, name, own, True, priors))]
    return Questioned(tuple(impossible), tuple(unusual))


def with_possible(hypotheses: HypothesisSet, found: Conclusion, asked: Sequence[Question]) -> Conclusion | None:
    """The conclusion with each impossible cause replaced by the next member of its class; None where a class has no other.

    An impossible cause has prior probability 0: the other members share its probability.
    """
    places = {(q.effect, q.site) for q in asked}
    model, classes = found.model, dict(found.classes)
    for cause in found.classes:
        if cause.place not in places:
            continue
        left = [m for m in classes.pop(cause) if m.recorded and m.hypothesis.place not in places]
        if not left:
            return None
        model = hypotheses.extended(without(hypotheses.groups, model, cause, sweeps=1), left[0].hypothesis)
        whole = sum(member.probability for member in left)
        likelier = [replace(member, probability=member.probability / whole) for member in left]
        classes[left[0].hypothesis] = tuple(likelier)
    return replace(found, model=model, classes=classes)


def without_impossible(
    hypotheses: HypothesisSet, found: Conclusion, asked: Sequence[Question], sure: Collection[tuple[str, str]]
) -> Conclusion:
    """The conclusion without impossible causes, with a doubt: an unknown cause looks like them.

    ``sure``: effects and sites that a search without the impossible causes names with confidence. Other causes are not named:
    they may explain the data only together with an impossible one.
    """
    places = {(q.effect, q.site) for q in asked}
    wrong = next(cause for cause in found.classes if cause.place == (asked[0].effect, asked[0].site))
    over = tuple(sorted(wrong.drivers(hypotheses.design.situation.robot)))
    kept = found.only(hypotheses, [cause for cause in found.classes if cause.place in {*sure} - places])
    return kept.doubted(Doubt("impossible", wrong.site, over))


def _outside(cause: Cause, name: str, own: Range, believed: bool, priors: Priors) -> Question | None:
    if name not in cause.parameters:
        return None
    found = cause.parameters[name]
    value, sigma, unit = found.value, found.sigma, found.unit
    if own.low <= value + priors.implausible * sigma and value - priors.implausible * sigma <= own.high:
        return None
    return Question(cause.effect, cause.site, name, value, sigma, unit, own.low, own.high, own.why, believed)
