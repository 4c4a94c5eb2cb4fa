"""Effects that go with what was not recorded: what was recorded tells how well they could stand in for a cause."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.candidates import Candidate
from gtpin.diagnosis.circumstances import WARMER
from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, gain
from gtpin.effects.situation import Column, Situation

Floats = npt.NDArray[np.float64]

USUAL, CONSTANT = 0.2, 0.05
"""Odds that an effect is there although nobody recorded what it goes with, over those of one that can be tested; the second
for sessions where nothing tells of a pause, and for payloads: a column that does not vary is often left out."""
LIKELY_SPEED = 0.1
"""Speed of a machine whose speed was not recorded, m/s or rad/s."""
PAUSE, MOST_PAUSES = 10.0, 11
"""Times the usual interval between visits from which it is a pause, after which a new session may have begun; and how many."""
BREAKS, TWO_BREAKS = 23, 7
"""Places in time at which one may have begun where there is no pause: where it is one, and where they are two."""
CLOCKS = ("time", "temp_frame", "temp_link")
PAYLOAD, SPELLS = 10.0, 12
"""A usual payload, kg, and spells of the work in which another one may have been carried."""
UNLOADED = "the payload may have varied without being recorded"
"""Why an effect that goes with forces could be what it does not look like by gravity of the robot alone."""


@dataclass(frozen=True)
class Hidden:
    """An effect that could stand in.

    Parameters
    ----------
    columns
        (N c, m) whitened displacements by a guess of what was not recorded.
    odds
        How likely that is, over an effect of what was recorded.
    reason
        Why it could be the cause, although it can be tested by what was recorded; empty where it can't.
    """

    candidate: Candidate
    columns: Floats
    odds: float
    reason: str = ""

    @property
    def name(self) -> str:
        """Of its group; unlike that of the same effect by what was recorded."""
        return f"{self.candidate.name} by what was not recorded"


def stand_ins(design: Design, untestable: Iterable[Candidate], testable: Iterable[Candidate]) -> Iterator[Hidden]:
    """Effects that lack a covariate, and effects of forces where the payload was not recorded, as far as there is a guess."""
    for candidate in untestable:
        columns = stand_in(design, candidate)
        if columns is not None:
            yield Hidden(candidate, columns, odds(design.situation, candidate))
    spells = _loaded(design.situation)
    if spells:
        for candidate in testable:
            if "payload" in candidate.coordinates(design.situation.robot):
                yield Hidden(candidate, _under(design, candidate, spells), CONSTANT, UNLOADED)


def _loaded(at: Situation) -> list[Situation]:
    """The situation with a payload in one spell of the work after the other; none where the payload was recorded."""
    clock = next((n for n in CLOCKS if at.varies(n)), None)
    if "payload" in at.covariates or clock is None:
        return []
    spell = np.argsort(np.argsort(at.covariate(clock))) * SPELLS // len(at)
    return [_with(at, "payload", np.where(spell == k, PAYLOAD, 0.0)) for k in range(SPELLS)]


def _under(design: Design, candidate: Candidate, spells: list[Situation]) -> Floats:
    """An effect's displacements, and by how much more its form moves with a payload in each spell."""
    effect, site = candidate.effect, candidate.site
    plain = design.columns(effect.basis(design.situation, site))
    form = list(effect.form) or list(range(plain.shape[1]))
    more = [design.columns(effect.basis(at, site))[:, form] - plain[:, form] for at in spells]
    return np.hstack([plain, *more])


def odds(at: Situation, candidate: Candidate) -> float:
    """How likely an effect is without what it goes with, over one that can be tested."""
    once = _missing(at, candidate) == ["session"] and not len(_pauses(at))
    return CONSTANT if once else USUAL


def stand_in(design: Design, candidate: Candidate) -> Floats | None:
    """(N c, m) whitened displacements of an effect whose covariate is missing, by what goes with that covariate.

    None where nothing recorded does, or something else than one missing covariate keeps it from being tested.
    """
    at, (effect, site) = design.situation, (candidate.effect, candidate.site)
    missing = _missing(at, candidate)
    if len(missing) != 1 or effect.has_setting:
        return None
    found = [
        np.hstack([design.columns(effect.basis(_with(at, missing[0], values), site)) for values in together])
        for together in _guesses(at, missing[0])
    ]
    return _best(design, found) if found else None


def _missing(at: Situation, candidate: Candidate) -> list[str]:
    return [name for name in candidate.effect.covariates(at.robot, candidate.site) if not at.has(name)]


def _with(at: Situation, name: str, values: Column) -> Situation:
    """The situation with a covariate that was not recorded; what was cached of it is computed again."""
    return replace(at, covariates={**at.covariates, name: values})


def _best(design: Design, found: list[Floats]) -> Floats:
    """The guess that fits best."""
    if len(found) == 1:
        return found[0]
    groups = Groups(Marginal(design.B), design.y)
    gains = []
    for columns in found:
        groups.set("guess", columns)
        gains.append(gain(groups, NOTHING, "guess")[0])
    return found[int(np.argmax(gains))]


def _guesses(at: Situation, name: str) -> Iterable[tuple[Column, ...]]:
    """What a missing covariate may have been: one after the other, each a few (N,) that are taken together."""
    numbered = re.fullmatch(r"(approach|speed)(\d+)", name)
    if numbered:
        other = f"{'speed' if numbered[1] == 'approach' else 'approach'}{numbered[2]}"
        if not at.varies(other):
            return []
        return [(np.sign(at.covariate(other)) * (1.0 if numbered[1] == "approach" else LIKELY_SPEED),)]
    if name == "session":
        return _sessions(at)
    if name == "time":
        clocks: list[tuple[Column, ...]] = [(at.covariate(n),) for n in CLOCKS if n != name and at.varies(n)]
        if at.varies("session"):
            clocks.append((np.unique(at.covariates["session"].astype(str), return_inverse=True)[1].astype(float),))
        return clocks
    if name in CLOCKS:
        return _temperatures(at, name)
    return []


def _sessions(at: Situation) -> Iterator[tuple[Column, ...]]:
    """New beginnings after pauses; where there are none, one or two in the course of time."""
    clock = next((n for n in CLOCKS if at.varies(n)), None)
    if clock is None:
        return
    values = at.covariate(clock)
    begun: list[Floats] = [np.quantile(values, places) for places in _places()]
    for since in [_pauses(at)] if len(_pauses(at)) else begun:
        yield (np.searchsorted(since, values, side="right").astype(str).astype(object),)


def _places() -> Iterator[Floats]:
    """Shares of the visits after which something new may have begun."""
    once, twice = (np.arange(1, n + 1) / (n + 1) for n in (BREAKS, TWO_BREAKS))
    yield from once[:, None]
    yield from (np.array(pair) for pair in combinations(twice, 2))


def _pauses(at: Situation) -> Floats:
    """Ends of the longest pauses between visits, s, in their order."""
    if not at.varies("time"):
        return np.zeros(0)
    time = np.sort(at.covariate("time"))
    waits = np.diff(time)
    longest = np.sort(np.argsort(-waits)[:MOST_PAUSES])
    return np.asarray(time[1:][longest[waits[longest] > PAUSE * np.median(waits)]])


def _temperatures(at: Situation, name: str) -> Iterable[tuple[Column, ...]]:
    """The other temperature, and slow changes over time."""
    reference = at.references.temperature
    together: list[Column] = [at.covariate(n) for n in CLOCKS[1:] if n != name and at.varies(n)]
    if at.varies("time"):
        together += [reference + WARMER * at.time, reference + WARMER * at.time**2]
    return [tuple(together)] if together else []
