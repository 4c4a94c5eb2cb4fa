"""All explanations that a search may choose from, and what each must be worth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Candidate, Free, related, same_motion
from gtpin.diagnosis.hypotheses.proxies import Hidden, stand_ins
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import NOTHING, Groups, Marginal, Posterior, all_gains, fixed
from gtpin.diagnosis.linear.scan import Scan
from gtpin.effects.basis import Basis

STRANGER = 5.0
"""What a free motion must be worth beyond what an effect must: what is listed is listed because it is common."""
SAME, RELATED, OTHER = 0.08, 0.05, 0.01
"""Share of a stronger cause's evidence that a further explanation must be worth, because causes depart from their forms:
at the same site over the same coordinates, where it could pass for the stronger one's departure, and elsewhere."""
THIRD = 4.0
"""What a third cause must be worth beyond that, and each further one: so many at once are rare."""

Gain = tuple[float, Candidate | Free]
"""Gain in log evidence, and what brings it: with its setting."""


@dataclass
class Pool:
    """Explanations and the inner products of their displacements; settings are found as the search goes.

    Parameters
    ----------
    design
        The linear problem.
    candidates
        By name; those with settings have the last one found.
    scanned
        Candidates whose setting must be scanned for.
    frees
        Free motions with their displacements.
    false_alarm
        Chance of naming a cause where there is none.
    untestable
        Effects that can't be tested: those that lack a covariate may stand in; see :mod:`~gtpin.diagnosis.hypotheses.proxies`.
    """

    design: Design
    candidates: dict[str, Candidate]
    scanned: tuple[Candidate, ...]
    frees: Iterable[tuple[Free, Basis]]
    false_alarm: float
    untestable: tuple[Candidate, ...] = ()
    latest: dict[str, Candidate | Free] = field(default_factory=dict)
    free: dict[str, Free] = field(default_factory=dict)
    scans: dict[str, Scan] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.groups = Groups(Marginal(self.design.B), self.design.y)
        self._to_scan = {c.name: c for c in self.scanned}
        self._known: dict[object, dict[str, Gain]] = {}
        for name, candidate in self.candidates.items():
            basis = candidate.effect.basis(self.design.situation, candidate.site)
            self.groups.set(name, self.design.columns(basis), candidate.effect.core)
        for free, basis in self.frees:
            self.free[free.name] = free
            self.groups.set(free.name, self.design.columns(basis))
        count = len(self.candidates) + len(self.scanned)
        self.threshold = float(np.log(max(count, 1)) + np.log(1.0 / self.false_alarm))

    @cached_property
    def hidden(self) -> dict[str, Hidden]:
        """Effects by a guess of what was not recorded; never in a model, only beside its causes."""
        found = {h.name: h for h in stand_ins(self.design, self.untestable, self.candidates.values())}
        for name, hidden in found.items():
            self.groups.set(name, hidden.columns)
        return found

    def cost(self, name: str) -> float:
        """Gain in log evidence that an explanation must bring, beside nothing."""
        return self.threshold + (STRANGER if name in self.free else 0.0)

    def share(self, name: str, stronger: str) -> float:
        """Share of a stronger explanation's evidence that another must be worth beside it."""
        robot, a, b = self.design.situation.robot, self.explanation(name), self.explanation(stronger)
        if a.site == b.site and a.drivers(robot) & b.drivers(robot):
            return SAME
        return RELATED if related(robot, a, b) else OTHER

    def explanation(self, name: str) -> Candidate | Free:
        """What has a name."""
        known = self.free.get(name) or self.candidates.get(name) or self._to_scan.get(name)
        return known or self.hidden[name].candidate

    def costs(self, names: Sequence[str]) -> dict[str, float]:
        """What each explanation of a model must be worth in it."""
        strength = self.gains(NOTHING, names)
        found = {}
        for name in names:
            stronger = [self.share(name, n) * strength[n] for n in names if strength[n] > strength[name]]
            found[name] = self.cost(name) + max(stronger, default=0.0) + (THIRD if len(stronger) > 1 else 0.0)
        return found

    def worth(self, model: Posterior) -> float:
        """Log evidence, less what its explanations must be worth."""
        return model.log_evidence - sum(self.costs(model.names).values())

    def net_gains(self, model: Posterior, names: Iterable[str]) -> dict[str, float]:
        """Gain in worth by adding each explanation to a model, to first order."""
        before = sum(self.costs(model.names).values())
        return {
            name: value - sum(self.costs((*model.names, name)).values()) + before
            for name, value in self.gains(model, names).items()
        }

    @property
    def named(self) -> tuple[str, ...]:
        """Names of all effects at their sites, scanned ones too."""
        return (*(n for n in self.candidates if n not in self._to_scan), *self._to_scan)

    def gains(self, model: Posterior, names: Iterable[str]) -> dict[str, float]:
        """Gain in log evidence by adding each explanation to a model, settings scanned for beside it."""
        settings = tuple(self.candidates[n].setting if n in self.candidates else None for n in model.names)
        known = self._known.setdefault((model.names, model.scale, settings), {})
        wanted = [n for n in names if n not in model.names]
        new = [n for n in wanted if n not in known]
        plain = all_gains(self.groups, model, (n for n in new if n not in self._to_scan))
        known |= {n: (value, self.explanation(n)) for n, (value, _) in plain.items()}
        known |= {n: self._scanned(n, model) for n in new if n in self._to_scan}
        found = {n: known[n] for n in wanted}
        self.latest |= {n: what for n, (_, what) in found.items()}
        return {n: value for n, (value, _) in found.items()}

    def _scanned(self, name: str, model: Posterior) -> Gain:
        candidate = self._to_scan[name]
        if name not in self.scans:
            self.scans[name] = Scan(self.design, self.groups.marginal, candidate.effect, candidate.site)
        columns = self.groups.columns
        together = np.hstack([np.zeros((len(self.design.y), 0)), *(columns[n] for n in model.names)])
        best = self.scans[name].best(model, together)
        return best.gain, replace(candidate, setting=best.setting, setting_sigma=best.sigma)

    def bends(self, free: str, name: str) -> bool:
        """Whether a free motion only says that a cause bends."""
        at, candidate = self.design.situation, self.settled(name)
        if self.free[free].site != candidate.site:
            return False
        basis = candidate.effect.basis(at, candidate.site, candidate.setting)
        return same_motion(at.robot, self.free[free], candidate, basis)

    def settled(self, name: str) -> Candidate:
        """A candidate, with the setting that was found for it last."""
        found = self.candidates.get(name) or self.latest.get(name)
        found = found or next(h.candidate for h in self.hidden.values() if h.candidate.name == name)
        assert isinstance(found, Candidate)
        return found

    def adopt(self, name: str) -> None:
        """Use the setting that the last scan found for a candidate."""
        latest = self.latest.get(name)
        if isinstance(latest, Candidate) and self.candidates.get(name) != latest:
            basis = latest.effect.basis(self.design.situation, latest.site, latest.setting)
            self.candidates[name] = latest
            self.groups.set(name, self.design.columns(basis), latest.effect.core)

    def only(self, model: Posterior, names: Iterable[str]) -> Posterior:
        """Some of a model's explanations, with their scales."""
        wanted = set(names)
        kept = [(n, s) for n, s in zip(model.names, model.scale, strict=True) if n in wanted]
        return fixed(self.groups, [n for n, _ in kept], [s for _, s in kept]) if kept else NOTHING
