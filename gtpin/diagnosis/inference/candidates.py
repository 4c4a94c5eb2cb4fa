"""All hypotheses that were considered as a cause, with their evidence and probability."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.hypotheses.propose import Untested
from gtpin.diagnosis.inference.findings import Considered
from gtpin.diagnosis.inference.verdict import Conclusion


def considered(
    hypotheses: HypothesisSet,
    found: Conclusion,
    untested: Iterable[Untested],
    could_be: Collection[tuple[str, str]],
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
