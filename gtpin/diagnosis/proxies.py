"""Effects whose covariate was not recorded, computed with a proxy of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, all_gains
from gtpin.diagnosis.hypothesis import CLOCK, Hypothesis
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.effects.catalogue import OWN
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.effects.untestable import Untestable
from gtpin.errors import warn
from gtpin.typing import Floats

UNLOADED = Untestable("unrecorded_payload", "payload")
"""Why an effect that depends on forces could be the cause although its test with the robot's own weight does not show it."""
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


@dataclass(frozen=True, eq=False)
class Proxy:
    """A hypothesis with a proxy in the place of a covariate that was not recorded.

    ``columns``: (N c, m) whitened displacements, computed with the proxy. ``odds``: prior odds
    of the hypothesis relative to a testable one. ``reason``: for a hypothesis that the recorded columns can test: why it could
    be the cause although that test does not show it. None for an untestable one.
    """

    hypothesis: Hypothesis
    columns: Floats
    odds: float
    reason: Untestable | None = None


def proxies(
    design: Design, untestable: Iterable[Hypothesis], testable: Iterable[Hypothesis], priors: Priors = PRIORS
) -> Iterator[Proxy]:
    """Proxies of effects with a missing covariate, and of effects of forces where the payload was not recorded."""
    at, failed = design.operating_points, dict[str, str]()
    for hypothesis in untestable:
        columns = _tried(hypothesis, partial(proxy_columns, design, hypothesis, priors), failed)
        if columns is not None:
            yield Proxy(hypothesis, columns, odds(at, hypothesis, priors))
    spells = loaded(at, priors)
    for hypothesis in testable if spells else ():
        if "payload" in hypothesis.coordinates(at.robot) and not hypothesis.effect.has_nonlinear:
            columns = _tried(hypothesis, partial(_under, design, hypothesis, spells), failed)
            if columns is not None:
                yield Proxy(hypothesis, columns, priors.not_varied, UNLOADED)
    for effect, why in failed.items():
        text = f"{effect} can't be tried with a proxy of what was not recorded ({why}): it is in no class"
        warn(text)


def _tried(hypothesis: Hypothesis, columns: Callable[[], Floats | None], failed: dict[str, str]) -> Floats | None:
    """The result of ``columns``. None where there is no proxy, where a displacement is not finite, or where a user's own effect
    fails with the proxy; ``failed`` then gets the error."""
    try:
        found = columns()
    except Exception as error:  # a user's effect may fail in any way
        if type(hypothesis.effect) in OWN:
            raise
        failed[hypothesis.effect.id] = f"{type(error).__name__}: {error}"
        return None
    return found if found is not None and np.isfinite(found).all() else None


def _under(design: Design, hypothesis: Hypothesis, spells: list[OperatingPoints]) -> Floats:
    """An effect's displacements, and those that a payload in each interval of time adds to its core."""
    effect, site = hypothesis.effect, hypothesis.site
    plain = design.columns(effect.basis(design.operating_points, site))
    core = list(effect.core) or list(range(plain.shape[1]))
    more = [design.columns(effect.basis(at, site))[:, core] - plain[:, core] for at in spells]
    return np.hstack([plain, *more])


def odds(at: OperatingPoints, hypothesis: Hypothesis, priors: Priors = PRIORS) -> float:
    """Prior odds of an effect with a missing covariate relative to a testable effect.

    They are 1 where the covariate was recorded but can't be used, and smaller for a session that began without a pause.
    """
    missing = _missing(at, hypothesis)
    if at.unusable.issuperset(missing):
        return 1.0
    once = missing == ["session"] and not len(pauses(at, priors))
    return priors.not_varied if once else priors.not_recorded


def proxy_columns(design: Design, hypothesis: Hypothesis, priors: Priors = PRIORS) -> Floats | None:
    """(N c, m) whitened displacements of an effect whose covariate is missing, by the proxy of that covariate that fits best.

    None where there is no proxy, or where the effect is untestable for another reason than one missing covariate.
    """
    at, (effect, site) = design.operating_points, (hypothesis.effect, hypothesis.site)
    missing = _missing(at, hypothesis)
    if len(missing) != 1 or effect.has_nonlinear:
        return None
    found: list[Floats] = [
        np.hstack([design.columns(effect.basis(at.with_covariate(missing[0], values), site)) for values in together])
        for together in guesses(at, missing[0], priors)
    ]
    if len(found) < 2:
        return found[0] if found else None
    groups: Groups[int] = Groups(Marginal(design.B), design.y)
    for i, columns in enumerate(found):
        groups.add(i, columns)
    gains = all_gains(groups, NOTHING, range(len(found)))
    best: int = max(gains, key=lambda i: gains[i])
    return found[best]


def _missing(at: OperatingPoints, hypothesis: Hypothesis) -> list[str]:
    return [name for name in hypothesis.effect.covariates(at.robot, hypothesis.site) if not at.has(name)]


def guesses(at: OperatingPoints, name: str, priors: Priors = PRIORS) -> Iterable[tuple[Column, ...]]:
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
    if name not in CLOCKS:
        return []
    # Of a temperature: the other temperature, and slow changes over time.
    together: list[Column] = [at.covariate(n) for n in CLOCKS[1:] if n != name and at.varies(n)]
    if at.varies("time"):
        reference = at.references.temperature
        together += [reference + priors.warmer * at.time, reference + priors.warmer * at.time**2]
    return [tuple(together)] if together else []


def _order(names: Column) -> Floats:
    """(N,) rank of each row's session: names that are numbers first, in order of the number, then the others as texts."""
    known = sorted({str(name) for name in names}, key=lambda n: (0, int(n), n) if n.isdecimal() else (1, 0, n))
    return np.array([known.index(str(name)) for name in names], dtype=float)


def _sessions(at: OperatingPoints, priors: Priors) -> Iterator[tuple[Column, ...]]:
    """New sessions after pauses; where there is no pause, one or two new sessions at tried instants."""
    clock = next((n for n in CLOCKS if at.varies(n)), None)
    if clock is None:
        return
    values, begun = at.covariate(clock), [pauses(at, priors)]
    if not len(begun[0]):
        once, twice = (np.arange(1, n + 1) / (n + 1) for n in (BREAKS, TWO_BREAKS))
        places = [*once[:, None], *(np.array(pair) for pair in combinations(twice, 2))]
        begun = [np.quantile(values, shares) for shares in places]
    for since in begun:
        yield (np.searchsorted(since, values, side="right").astype(str).astype(object),)


def pauses(at: OperatingPoints, priors: Priors = PRIORS) -> Floats:
    """Ends of the longest pauses between visits, s, in the order of time."""
    if not at.varies("time"):
        return np.zeros(0)
    time = np.sort(at.covariate("time"))
    waits = np.diff(time)
    longest = np.sort(np.argsort(-waits)[:MOST_PAUSES])
    # Not the median: it is 0 where a clock shows whole minutes only and most visits follow within a minute.
    usual = np.sort(waits)[: max(int(SHORT * len(waits)), 1)].mean()
    return np.asarray(time[1:][longest[waits[longest] > priors.pause * max(float(usual), 1e-9)]])


def loaded(at: OperatingPoints, priors: Priors = PRIORS) -> list[OperatingPoints]:
    """Situations with a payload in one interval of time each, as proxies; none where the payload was recorded."""
    clock = next((n for n in CLOCKS if at.varies(n)), None)
    if "payload" in at.covariates or clock is None:
        return []
    spell = np.argsort(np.argsort(at.covariate(clock))) * SPELLS // len(at)
    return [at.with_covariate("payload", np.where(spell == k, priors.payload, 0.0)) for k in range(SPELLS)]
