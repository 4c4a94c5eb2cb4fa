"""Proxies of covariates that were not recorded, from columns that were."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import combinations

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import CLOCK
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.effects.situation import Column, Situation
from gtpin.typing import Floats

MOST_PAUSES = 11
"""Largest number of pauses after which a new session is assumed."""
SHORT = 0.95
"""Share of the intervals between visits whose mean is the usual interval: the shortest ones, which are no pauses."""
BREAKS, TWO_BREAKS = 23, 7
"""Where there is no pause: number of instants at which one new session is tried, and number of those at which two are."""
CLOCKS = tuple(name for name in CLOCK if name != "session")
"""Numeric coordinates that change with time."""
SPELLS = 12
"""Number of intervals of time. In each, a payload that was not recorded may have been carried."""


def guesses(at: Situation, name: str, priors: Priors = PRIORS) -> Iterable[tuple[Column, ...]]:
    """Proxies of the missing covariate ``name``: each item is one or more columns (N,) that are used together."""
    numbered = re.fullmatch(r"(approach|speed)(\d+)", name)
    if numbered:
        other = f"{'speed' if numbered[1] == 'approach' else 'approach'}{numbered[2]}"
        if not at.varies(other):
            return []
        return [(np.sign(at.covariate(other)) * (1.0 if numbered[1] == "approach" else priors.likely_speed),)]
    if name == "session":
        return _sessions(at, priors)
    if name == "time":
        clocks: list[tuple[Column, ...]] = [(at.covariate(n),) for n in CLOCKS if n != name and at.varies(n)]
        if at.varies("session"):
            clocks.append((_order(at.covariates["session"]),))
        return clocks
    if name in CLOCKS:
        return _temperatures(at, name, priors)
    return []


def _order(names: Column) -> Floats:
    """(N,) rank of each row's session: names that are numbers first, in order of the number, then the others as texts."""
    known = sorted({str(name) for name in names}, key=lambda n: (0, int(n), n) if n.isdecimal() else (1, 0, n))
    return np.array([known.index(str(name)) for name in names], dtype=float)


def _sessions(at: Situation, priors: Priors) -> Iterator[tuple[Column, ...]]:
    """New sessions after pauses; where there is no pause, one or two new sessions at tried instants."""
    clock = next((n for n in CLOCKS if at.varies(n)), None)
    if clock is None:
        return
    values = at.covariate(clock)
    begun: list[Floats] = [np.quantile(values, places) for places in _places()]
    for since in [pauses(at, priors)] if len(pauses(at, priors)) else begun:
        yield (np.searchsorted(since, values, side="right").astype(str).astype(object),)


def _places() -> Iterator[Floats]:
    """Shares of the visits after which a new session is tried."""
    once, twice = (np.arange(1, n + 1) / (n + 1) for n in (BREAKS, TWO_BREAKS))
    yield from once[:, None]
    yield from (np.array(pair) for pair in combinations(twice, 2))


def pauses(at: Situation, priors: Priors = PRIORS) -> Floats:
    """Ends of the longest pauses between visits, s, in the order of time."""
    if not at.varies("time"):
        return np.zeros(0)
    time = np.sort(at.covariate("time"))
    waits = np.diff(time)
    longest = np.sort(np.argsort(-waits)[:MOST_PAUSES])
    # Not the median: it is 0 where a clock shows whole minutes only and most visits follow within a minute.
    usual = np.sort(waits)[: max(int(SHORT * len(waits)), 1)].mean()
    return np.asarray(time[1:][longest[waits[longest] > priors.pause * max(float(usual), 1e-9)]])


def _temperatures(at: Situation, name: str, priors: Priors) -> Iterable[tuple[Column, ...]]:
    """Proxy of a temperature: the other temperature, and slow changes over time."""
    reference = at.references.temperature
    together: list[Column] = [at.covariate(n) for n in CLOCKS[1:] if n != name and at.varies(n)]
    if at.varies("time"):
        together += [reference + priors.warmer * at.time, reference + priors.warmer * at.time**2]
    return [tuple(together)] if together else []


def loaded(at: Situation, priors: Priors = PRIORS) -> list[Situation]:
    """Situations with a payload in one interval of time each, as proxies; none where the payload was recorded."""
    clock = next((n for n in CLOCKS if at.varies(n)), None)
    if "payload" in at.covariates or clock is None:
        return []
    spell = np.argsort(np.argsort(at.covariate(clock))) * SPELLS // len(at)
    return [with_column(at, "payload", np.where(spell == k, priors.payload, 0.0)) for k in range(SPELLS)]


def with_column(at: Situation, name: str, values: Column) -> Situation:
    """The situation with values (N,) for a covariate that was not recorded."""
    return at.with_covariate(name, values)
