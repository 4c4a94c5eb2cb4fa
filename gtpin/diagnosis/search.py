"""Which effects, together, explain the residuals: forward steps from several beginnings, swaps and removals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import Conditional, Marginal, Posterior, fixed, tuned
from gtpin.diagnosis.scan import Scan
from gtpin.effects.effect import Effect

Floats = npt.NDArray[np.float64]

BEAM = 4
"""Beginnings that are grown side by side: the best single effect need not be one of the best pair."""
MOST = 5
"""Effects that are named at most."""
SHORTLIST = 12
"""Candidates whose gain is worth a closer look at each step."""


@dataclass(frozen=True)
class Candidate:
    """An effect at a site, with the setting of what is not linear in it."""

    effect: Effect
    site: str
    setting: float | None = None

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect.id}@{self.site}"


@dataclass
class Pool:
    """All candidates, and the inner products of their displacements; settings are found as the search goes.

    Parameters
    ----------
    design
        The linear problem.
    candidates
        By name; those with settings have the last one found.
    scanned
        Candidates whose setting must be scanned for.
    threshold
        Gain in log evidence from which an effect is believed.
    """

    design: Design
    candidates: dict[str, Candidate]
    scanned: tuple[Candidate, ...]
    threshold: float
    columns: dict[str, Floats] = field(default_factory=dict)
    latest: dict[str, Candidate] = field(default_factory=dict)
    scans: dict[str, Scan] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.marginal = Marginal(self.design.B)
        for name, candidate in self.candidates.items():
            self.columns[name] = self.design.columns(candidate.effect.basis(self.design.situation, candidate.site))
        self.products = self.marginal.products(self.design.y, self.columns)

    @property
    def empty(self) -> Posterior:
        """The model without effects."""
        return fixed(self.products, (), ())

    def set(self, candidate: Candidate) -> None:
        """Give a scanned candidate its setting."""
        basis = candidate.effect.basis(self.design.situation, candidate.site, candidate.setting)
        self.candidates[candidate.name] = candidate
        self.columns[candidate.name] = self.design.columns(basis)
        self.products = self.products.extended(self.marginal, self.design.y, self.columns, candidate.name)

    def gains(self, model: Posterior, excluded: Sequence[str] = ()) -> dict[str, float]:
        """Gain in log evidence by adding each candidate to a model, settings scanned for beside it."""
        beside = Conditional.on(self.products, model)
        names = [n for n in self.candidates if n not in model.names and n not in excluded]
        scanned = {c.name for c in self.scanned}
        found = {n: beside.single(n)[0] for n in names if n not in scanned}
        for candidate in self.scanned:
            if candidate.name in model.names or candidate.name in excluded:
                continue
            best = self._scan(candidate, model)
            if best is not None:
                found[candidate.name] = best
        return found

    def _scan(self, candidate: Candidate, model: Posterior) -> float | None:
        if candidate.name not in self.scans:
            self.scans[candidate.name] = Scan(self.design, self.marginal, candidate.effect, candidate.site)
        together = np.hstack([np.zeros((len(self.design.y), 0)), *(self.columns[n] for n in model.names)])
        best = self.scans[candidate.name].best(model, together)
        if best is None:
            return None
        self.latest[candidate.name] = Candidate(candidate.effect, candidate.site, best.setting)
        return best.gain

    def adopt(self, name: str) -> None:
        """Use the setting that the last scan found for a candidate."""
        if name in self.latest and self.candidates.get(name) != self.latest[name]:
            self.set(self.latest[name])


def search(pool: Pool) -> Posterior:
    """The model of effects with the largest evidence that was found."""
    singles = pool.gains(pool.empty)
    order = sorted(singles, key=lambda n: -singles[n])
    best = pool.empty
    for name in order[:BEAM]:
        if singles[name] < pool.threshold:
            break
        pool.adopt(name)
        grown = _grow(pool, tuned(pool.products, (name,), (1.0,)))
        if _worth(pool, grown) > _worth(pool, best):
            best = grown
    return best


def _worth(pool: Pool, model: Posterior) -> float:
    """Log evidence, less what naming each effect must be worth."""
    return model.log_evidence - pool.threshold * len(model.names)


def _grow(pool: Pool, model: Posterior) -> Posterior:
    while len(model.names) < MOST:
        gains = pool.gains(model)
        name = max(gains, key=lambda n: gains[n], default=None)
        if name is None or gains[name] < pool.threshold:
            return model
        pool.adopt(name)
        larger = tuned(pool.products, (*model.names, name), (*model.scale, 1.0))
        larger = _pruned(pool, _swapped(pool, larger))
        if _worth(pool, larger) <= _worth(pool, model) + 1e-9:
            return model
        model = larger
    return model


def _swapped(pool: Pool, model: Posterior) -> Posterior:
    """The model after every exchange of one effect for another that raises the evidence."""
    for _ in range(3):
        before = model.log_evidence
        for name in model.names:
            rest = _without(pool, model, name)
            beside = Conditional.on(pool.products, rest)
            gains = {n: beside.single(n)[0] for n in pool.products.groups if n not in rest.names}
            other = max(gains, key=lambda n: gains[n])
            if other != name and gains[other] > gains[name] + 0.5:
                trial = tuned(pool.products, (*rest.names, other), (*rest.scale, 1.0))
                if trial.log_evidence > model.log_evidence:
                    model = trial
                    break
        if model.log_evidence <= before:
            return model
    return model


def _pruned(pool: Pool, model: Posterior) -> Posterior:
    """The model without the effects that it can do without."""
    while model.names:
        losses = {n: model.log_evidence - _without(pool, model, n).log_evidence for n in model.names}
        weakest = min(losses, key=lambda n: losses[n])
        if losses[weakest] >= pool.threshold:
            return model
        model = _without(pool, model, weakest)
    return model


def _without(pool: Pool, model: Posterior, name: str) -> Posterior:
    kept = [(n, s) for n, s in zip(model.names, model.scale, strict=True) if n != name]
    return tuned(pool.products, [n for n, _ in kept], [s for _, s in kept], sweeps=1)


def alternatives(pool: Pool, model: Posterior, name: str) -> Mapping[str, float]:
    """Log evidence of the model with each candidate in the place of one of its effects, over the model without it."""
    return pool.gains(_without(pool, model, name))
