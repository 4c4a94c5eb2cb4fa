"""Questions: parameters of causes with values that are impossible or unusual."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.findings import Cause, Doubt, Question
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.exchange import without
from gtpin.diagnosis.priors import Priors


def questions(found: Conclusion, causes: Iterable[Cause], priors: Priors) -> list[Question]:
    """Compare parameters of causes with the ranges that their effects state as plausible and usual.

    A cause with an impossible parameter is not named; with an unusual one it is (``believed``). The impossible ones come first.
    """
    effects, asked = {hypothesis.place: hypothesis.effect for hypothesis in found.classes}, list[Question]()
    for cause in causes:
        effect = effects[cause.effect, cause.site]
        for ranges, believed in ((effect.plausible, False), (effect.usual, True)):
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
