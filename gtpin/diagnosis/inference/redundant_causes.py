"""One cause that goes with what nobody recorded is not reported as two."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from gtpin.diagnosis.hypotheses.hypothesis_set import Pool
from gtpin.diagnosis.linear.evidence import Posterior, without
from gtpin.diagnosis.result import Member


def without_doubles(pool: Pool, named: Posterior, members: Callable[[Posterior, str], Iterable[Member]]) -> Posterior:
    """Leave out causes that are not needed once an unrecorded effect stands in the place of a stronger one.

    A stand-in's imitator leaves something that a second imitator takes. Where the first may be the stand-in, the second has
    nothing to show for itself: nor where it may be the same stand-in, of which a guess does not tell all.

    Parameters
    ----------
    members
        The class of a cause of a model.
    """
    strength = {name: named.log_evidence - without(pool.groups, named, name).log_evidence for name in named.names}
    for name in sorted(named.names, key=lambda n: -strength[n]):
        if name not in named.names:
            continue
        unrecorded = {f"{m.effect}@{m.site}" for m in members(named, name) if not m.recorded}
        for key in [key for key, hidden in pool.hidden.items() if hidden.candidate.name in unrecorded]:
            same = pool.hidden[key].candidate.name
            weaker = [n for n in named.names if strength[n] < strength[name]]
            needless = [
                n
                for n in weaker
                if same in {f"{m.effect}@{m.site}" for m in members(named, n)} or _needless(pool, named, name, key, n)
            ]
            named = pool.only(named, (n for n in named.names if n not in needless))
    return named


def _needless(pool: Pool, named: Posterior, name: str, key: str, other: str) -> bool:
    """Whether another cause is not worth its cost once a stand-in is in the place of a cause."""
    rest = without(pool.groups, named, name)
    less = without(pool.groups, rest, other)
    with_other = rest.log_evidence + pool.gains(rest, (key,))[key]
    alone = less.log_evidence + pool.gains(less, (key,))[key]
    return with_other - alone < pool.costs(named.names)[other]
