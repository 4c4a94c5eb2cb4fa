"""From evidence to a verdict: which causes are named, how sure each is, and whether something unknown is there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import expit

from gtpin.diagnosis.hypotheses.hypothesis import Free, related, same_place
from gtpin.diagnosis.hypotheses.hypothesis_set import STRANGER, Pool
from gtpin.diagnosis.inference.redundant_causes import without_doubles
from gtpin.diagnosis.inference.search import search
from gtpin.diagnosis.linear.evidence import NOTHING, Posterior, tuned, without
from gtpin.diagnosis.result import Member, Verdict

CLASS_SHARE = 0.05
"""Share of the leader's probability from which an effect belongs to its class."""
SURE = 0.95
"""Probability from which a cause stands alone."""
TEMPERATURE, WARMING, WARMEST = 2.0, 0.004, 6.0
"""Gains in log evidence are divided by this, and by a share of the evidence at stake, before they become probabilities: forms
are never exactly the machine's, and that tells the more the better it is seen."""
DEPARTURE, BENDING = 0.025, 0.06
"""Share of what free motions explain, by which they must be ahead of named causes, which depart from their forms by as much;
the second where the motions are a named cause's own."""


@dataclass(frozen=True)
class Decision:
    """What is believed.

    Parameters
    ----------
    verdict
        As in reports.
    named
        The model of the causes that are named.
    classes
        Of each cause, by name: itself and what could stand in for it, the likeliest first.
    strangers
        Free motions that are needed beside the causes.
    unknown
        Probability that something unknown is there.
    gains
        Gain in log evidence of every explanation by itself.
    """

    verdict: Verdict
    named: Posterior
    classes: Mapping[str, tuple[Member, ...]]
    strangers: tuple[Free, ...]
    unknown: float
    gains: Mapping[str, float]


def rough_guess(pool: Pool) -> Posterior:
    """The model of everything that is no noise, as far as one search finds it."""
    names = (*pool.named, *pool.free)
    return search(pool, names, pool.gains(NOTHING, names), beginnings=1)


def decide(pool: Pool) -> Decision:
    """Search with and without free motions, and weigh what was found."""
    singles = pool.gains(NOTHING, (*pool.named, *pool.free))
    named = search(pool, pool.named, singles)
    mixed = search(pool, (*pool.named, *pool.free), singles)
    strangers = tuple(pool.free[n] for n in mixed.names if n in pool.free)
    unknown = _unknown(pool, mixed, named) if strangers else 0.0
    if unknown > 0.5:
        named = pool.only(mixed, _apart(pool, mixed))
    elif strangers := _replacing(pool, named):
        unknown = 1.0 - min(sum(m.probability for m in _class(pool, named, n)) for n in named.names)
        better = tuned(
            pool.groups, (*named.names, *(f.name for f in strangers)), (*named.scale, *(1.0 for _ in strangers))
        )
        named = pool.only(better, _apart(pool, better))
    named = without_doubles(pool, _led(pool, named), partial(_class, pool))
    classes = {name: _class(pool, named, name) for name in named.names}
    if unknown > 0.5:
        named = pool.only(named, (n for n in named.names if classes[n][0].probability >= SURE))
        classes = {name: classes[name] for name in named.names}
    return Decision(verdict_of(unknown, classes), named, classes, strangers if unknown > 0.5 else (), unknown, singles)


def with_fine(pool: Pool, found: Decision, site: str) -> Decision:
    """The same, where an actuator errs in a way that no smooth motion follows: its own causes are no longer believed."""
    own = f"q{pool.design.situation.robot.sites.index(site) + 1}"
    names = [n for n in found.named.names if split(n)[1] != site and found.classes[n][0].probability >= SURE]
    classes = {n: found.classes[n] for n in names}
    stranger = Free(site, (own,), "fine")
    return replace(
        found,
        verdict="unknown",
        named=pool.only(found.named, names),
        classes=classes,
        strangers=(stranger,),
        unknown=1.0,
    )


def _unknown(pool: Pool, mixed: Posterior, named: Posterior) -> float:
    """Probability of a model with free motions beside one without."""
    known = pool.only(mixed, (n for n in mixed.names if n not in pool.free))
    frees = [n for n in mixed.names if n in pool.free]
    bent = all(any(pool.bends(free, name) for name in named.names) for free in frees)
    doubt = (BENDING if bent else DEPARTURE) * (mixed.log_evidence - known.log_evidence)
    ahead = pool.worth(mixed) - pool.worth(named) - doubt
    return float(expit(ahead / _temperature(max(named.log_evidence, 0.0))))


def _replacing(pool: Pool, named: Posterior) -> tuple[Free, ...]:
    """Free motions that are likelier than a cause and everything that could stand in for it."""
    found = []
    for name in named.names:
        if sum(m.probability for m in _class(pool, named, name)) < 0.5:
            rest = without(pool.groups, named, name, sweeps=1)
            gains = pool.gains(rest, _others(pool, name))
            found.append(pool.free[max(gains, key=lambda n: gains[n])])
    return tuple(dict.fromkeys(found))


def _temperature(evidence: float) -> float:
    return min(TEMPERATURE + WARMING * evidence, WARMEST)


def _led(pool: Pool, named: Posterior) -> Posterior:
    """The model with the leader of each class in the place of its cause, where the evidence is for it."""
    for name in named.names:
        first = _class(pool, named, name)[0]
        leader = f"{first.effect}@{first.site}"
        if leader not in named.names:
            pool.adopt(leader)
            rest = without(pool.groups, named, name, sweeps=1)
            trial = tuned(pool.groups, (*rest.names, leader), (*rest.scale, 1.0))
            named = trial if trial.log_evidence > named.log_evidence else named
    return named


def _apart(pool: Pool, model: Posterior) -> tuple[str, ...]:
    """Causes that have nothing to do with the free motions beside them, and are far beyond doubt."""
    robot = pool.design.situation.robot
    frees = [pool.free[n] for n in model.names if n in pool.free]
    costs = pool.costs(model.names)
    sure = []
    for name in model.names:
        if name in pool.free:
            continue
        loss = model.log_evidence - without(pool.groups, model, name).log_evidence
        own = pool.explanation(name)
        apart = not any(same_place(robot, own, free) or related(robot, own, free) for free in frees)
        if apart and loss > 2.0 * costs[name]:
            sure.append(name)
    return tuple(sure)


def _class(pool: Pool, model: Posterior, name: str) -> tuple[Member, ...]:
    """Everything that could stand in for a cause, the likeliest first; a free motion only takes probability away.

    What goes with something that was not recorded is at most as likely as the likeliest that goes with what was.
    """
    rest = without(pool.groups, model, name, sweeps=1)
    gains = pool.gains(rest, pool.named)
    own = gains[name]
    dear = STRANGER + DEPARTURE * max(own, 0.0)
    strange = [value - dear for value in pool.gains(rest, _others(pool, name)).values()]
    log = {n: value / _temperature(max(own, 0.0)) for n, value in gains.items()}
    likeliest, lifted = max(log.values()), set()
    for key, value in pool.gains(rest, pool.hidden).items():
        n = pool.hidden[key].candidate.name
        unrecorded = value / _temperature(max(own, 0.0)) + float(np.log(pool.hidden[key].odds))
        if unrecorded > log.get(n, -np.inf):
            log[n] = min(unrecorded, likeliest)
            lifted.add(n)
    whole = np.logaddexp.reduce([*log.values(), max(strange, default=-np.inf) / _temperature(max(own, 0.0))])
    probability = {n: float(np.exp(value - whole)) for n, value in log.items()}
    least = CLASS_SHARE * max(probability.values())
    members = [Member(*split(n), p, n not in lifted) for n, p in probability.items() if p >= least or n == name]
    return tuple(sorted(members, key=lambda m: (-m.probability, (m.effect, m.site) != split(name))))


def _others(pool: Pool, name: str) -> list[str]:
    """Free motions that do not merely say that a cause bends."""
    return [n for n in pool.free if not pool.bends(n, name)]


def split(name: str) -> tuple[str, str]:
    """Effect and site of ``effect@site``."""
    effect, _, site = name.partition("@")
    return effect, site


def verdict_of(unknown: float, classes: Mapping[str, tuple[Member, ...]]) -> Verdict:
    """The verdict, by the probability of something unknown and the causes' classes."""
    if unknown > 0.5:
        return "unknown"
    if any(members[0].probability < SURE for members in classes.values()):
        return "ambiguous"
    return "explained" if classes else "none"
