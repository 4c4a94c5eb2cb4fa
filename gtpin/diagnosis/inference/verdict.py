"""The conclusion of a diagnosis, its verdict, and every hypothesis that was considered."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, Gain, HypothesisSet, Term, scales
from gtpin.diagnosis.hypotheses.propose import Untested
from gtpin.diagnosis.inference.findings import Considered, Doubt, FlexibleFamily, Member, Verdict
from gtpin.diagnosis.linear.posterior import NOTHING, fixed
from gtpin.diagnosis.priors import SURE, UNDECIDED
from gtpin.effects.effect import Nature


@dataclass(frozen=True)
class Contender:
    """A hypothesis that could be the cause, with its probability.

    ``hypothesis``, ``probability``: the hypothesis, and how probable it is. ``recorded``: false where only a proxy shows it.
    ``beside``: another hypothesis, where only both together could be in the place of the cause.
    """

    hypothesis: Hypothesis
    probability: float
    recorded: bool = True
    beside: Hypothesis | None = None


@dataclass(frozen=True)
class Conclusion:
    """The conclusion from the evidence: causes, their classes, and doubts.

    ``model``: the causes that are named. ``classes``: for each cause its class with the cause itself, the most probable member
    first. ``doubts``: reasons for which something unknown is assumed in addition to the causes. ``alone``: gain in log evidence
    of every hypothesis and smooth term as the only one. ``beside``: the smooth terms that are needed beside the causes.
    ``also``: those causes that are weak and undecided: they do not change the verdict. ``descriptions``: flexible families that
    fit and are no causes. ``mechanisms``: places of the causes that are such families, but have a mechanism's form.
    """

    model: Explanation
    classes: Mapping[Hypothesis, tuple[Contender, ...]]
    doubts: tuple[Doubt, ...]
    alone: Mapping[Term, Gain]
    beside: Explanation = NOTHING
    also: tuple[Hypothesis, ...] = ()
    descriptions: tuple[FlexibleFamily, ...] = ()
    mechanisms: frozenset[tuple[str, str]] = frozenset()

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

    def whole(self, hypotheses: HypothesisSet) -> Explanation:
        """The model of the causes with the smooth terms beside them."""
        model, beside = self.model, self.beside
        if not beside.terms:
            return model
        return fixed(hypotheses.groups, (*model.terms, *beside.terms), (*model.scale, *beside.scale))

    def doubted(self, *doubts: Doubt) -> Conclusion:
        """The conclusion with further doubts."""
        return replace(self, doubts=(*self.doubts, *doubts))

    def only(self, hypotheses: HypothesisSet, causes: list[Hypothesis]) -> Conclusion:
        """The conclusion with only some of its causes."""
        classes = {cause: self.classes[cause] for cause in causes}
        return replace(self, model=hypotheses.only(self.model, causes), classes=classes)

    def nature(self, cause: Hypothesis) -> Nature:
        """The nature of a cause: a flexible family is a mechanism only where its form was found to be one."""
        return "mechanism" if cause.place in self.mechanisms else cause.effect.nature

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
        """Causes that stand beside something unknown: surely one of their class, so that no smooth term is in their place."""
        return [
            cause
            for cause, members in self.classes.items()
            if members[0].probability >= UNDECIDED and sum(m.probability for m in members) >= SURE
        ]


def considered(
    hypotheses: HypothesisSet, found: Conclusion, untested: Iterable[Untested], could_be: Collection[tuple[str, str]]
) -> tuple[Considered, ...]:
    """All hypotheses that were tested, the largest gain in log evidence first, then those that could not be tested."""
    members = [m for contenders in found.classes.values() for m in contenders]
    probability = {m.hypothesis.place: m.probability for m in members}
    asked = {m.hypothesis.place for m in members if not m.recorded} | set(could_be)
    reason = {p.hypothesis.place: p.reason for p in hypotheses.proxies if p.hypothesis.place in asked}
    tested = [
        Considered(*h.place, found.alone[h].value, probability.get(h.place, 0.0), True, reason.get(h.place))
        for h in hypotheses.named
    ]
    others = [
        Considered(*u.hypothesis.place, 0.0, probability.get(u.hypothesis.place, 0.0), False, u.reason)
        for u in untested
    ]
    return (*sorted(tested, key=lambda row: -row.log_evidence), *others)
