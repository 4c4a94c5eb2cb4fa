"""A case after its seal was opened: the truth, and the part of the diagnosis that is scored."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel

from gtpin.bench.blind.truth import Kind, TrueEffect

CONFIDENT = 0.95
"""Smallest probability of a cause that is named with confidence."""


class Named(BaseModel, frozen=True):
    """A cause in the diagnosis: ``effect@site``, its probability, and the members of its class with their probabilities."""

    name: str
    probability: float
    members: dict[str, float]
    parameters: dict[str, tuple[float, float]] = {}


class Statement(BaseModel, frozen=True):
    """The scored part of a diagnosis."""

    # As in ``diagnosis.json``; names are ``effect@site``
    verdict: Literal["none", "explained", "ambiguous", "unknown"]
    causes: tuple[Named, ...] = ()  # The largest first
    site: str = ""  # Site with the largest share in ``where``; empty if all shares are zero
    explained_fraction: float | None = None
    interval: tuple[float, float] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Causes, ``effect@site``."""
        return tuple(cause.name for cause in self.causes)

    @property
    def members(self) -> frozenset[str]:
        """The classes of all causes together."""
        return frozenset(name for cause in self.causes for name in (cause.name, *cause.members))

    @staticmethod
    def of(diagnosis: Mapping[str, Any]) -> Statement:
        """Read the content of ``diagnosis.json``."""
        shares, gap = diagnosis["where"]["site"], diagnosis["gap"]
        leading = max(shares, key=lambda site: shares[site], default="")

        def name(record: Mapping[str, Any]) -> str:
            return f"{record['effect']}@{record['site']}"

        causes = [
            Named(
                name=name(cause),
                probability=cause["probability"],
                members={name(member): member["probability"] for member in cause["class"]},
                parameters={k: (p["value"], p["sigma"]) for k, p in cause["parameters"].items()},
            )
            for cause in diagnosis["causes"]
        ]
        return Statement(
            verdict=diagnosis["verdict"],
            causes=tuple(causes),
            site=leading if leading and shares[leading] > 0.0 else "",
            explained_fraction=gap["shrinkage"],
            interval=gap["interval"],
        )


VISIBLE = 63.0
"""Energy above which an effect must be detected (E) and named (D): 4 times the 15.8 of a matched filter (95 %, 1 % alarms)."""
LEFT = 250.0
"""Energy of an unlisted effect that known effects must leave unexplained, so that the verdict must be `unknown`."""


class Shrunk(BaseModel, frozen=True):
    """RMS length of the position error at held-out commands, against the true poses, m; where other instruments than a tracker
    alone measured, RMS error of their readings in units of the noise."""

    before: float  # Of the geometry alone
    after: float  # Of the model with the named causes

    @property
    def share(self) -> float:
        """Explained fraction of the gap: 1 - (after / before)^2."""
        return 1.0 - (self.after / self.before) ** 2 if self.before > 0.0 else 0.0


class Judged(BaseModel, frozen=True):
    """A case, its truth and its diagnosis."""

    name: str
    kind: Kind | None = None  # Kind of case; None if its seal was broken
    poses: int = 0  # Rows of the dataset
    planned: int = 0  # Different commands among them
    truth: tuple[TrueEffect, ...] = ()  # Its true effects with E and D, without displacements
    rival: str = ""  # The wrong effect that leaves the least energy of a single true effect; empty where not known
    listed: bool = True  # Whether all its effects are in the catalogue
    instruments: tuple[str, ...] | None = None  # Kinds of the instruments that measured it; None for a tracker alone
    testable: bool = True  # Whether the dataset has the covariates that its known effects need
    error: str | None = None  # Message of the error if the case failed
    said: Statement | None = None  # The scored part of the diagnosis; None if the case failed
    # Energy of a single true effect that remains when another effect is fitted to it, by that effect: each member of
    # the named class, and the true effect in its textbook form
    left: dict[str, float] = {}
    without: Statement | None = None  # The diagnosis with the true effect removed from the catalogue
    without_error: str | None = None  # The error if that failed
    without_left: float | None = None  # The energy that the best of the other effects leaves
    shrunk: Shrunk | None = None  # None without true poses, or if the case failed
    # Name, value, sigma and true value of the parameters of causes that are named correctly
    parameters: tuple[tuple[str, float, float, float], ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """The true effects, ``effect@site``."""
        return frozenset(effect.name for effect in self.truth)

    @property
    def single(self) -> TrueEffect:
        """The effect of a case that has one."""
        (effect,) = self.truth
        return effect

    @property
    def noncentrality(self) -> float:
        """E of a single effect, its whitened energy; NaN if not known."""
        return float("nan") if self.single.energy is None else self.single.energy

    @property
    def leaves(self) -> float:
        """D of a single effect, the energy that the best wrong effect leaves; NaN if not known."""
        return float("nan") if self.single.leaves is None else self.single.leaves

    @property
    def verdict(self) -> str:
        """As in ``diagnosis.json``; empty where the case failed."""
        return self.said.verdict if self.said else ""

    @property
    def named(self) -> frozenset[str]:
        """The named causes, ``effect@site``."""
        return frozenset(self.said.names) if self.said else frozenset()

    @property
    def detected(self) -> bool:
        """Whether the verdict is not `none`."""
        return self.verdict not in ("", "none")

    @property
    def where(self) -> bool:
        """Whether the site that leads is that of the single effect."""
        return self.said is not None and self.said.site == self.single.site

    @property
    def strict(self) -> bool:
        """Whether exactly the true effects are named, and the verdict is not `unknown`."""
        return self.verdict not in ("", "unknown") and self.named == self.names

    @property
    def in_class(self) -> bool:
        """Whether the classes contain all true effects."""
        return self.said is not None and bool(self.names) and self.names <= self.said.members

    @property
    def false_names(self) -> tuple[str, ...]:
        """Named causes that are not true."""
        return tuple(n for n in self.said.names if n not in self.names) if self.said else ()

    @property
    def false_confident(self) -> tuple[str, ...]:
        """Causes named with a probability of 0.95 or more that are not true."""
        named = ((cause.name, cause.probability) for cause in (self.said.causes if self.said else ()))
        return tuple(name for name, probability in named if probability >= CONFIDENT and name not in self.names)

    @property
    def overstated(self) -> float | None:
        """The explained fraction of the gap that is predicted, less the one realised; None where one is not known."""
        if self.said is None or self.said.explained_fraction is None or self.shrunk is None:
            return None
        return self.said.explained_fraction - self.shrunk.share

    @property
    def f1(self) -> float:
        """F1 of the set of causes."""
        return _f1(self.named, self.names)

    @property
    def not_visible(self) -> frozenset[str]:
        """True effects that need not be found: their E is known, and not more than `VISIBLE`."""
        return frozenset(e.name for e in self.truth if e.energy is not None and e.energy <= VISIBLE)

    @property
    def visible_f1(self) -> float:
        """F1 of the set of causes without the effects that are not visible, whether they are named or not."""
        return _f1(self.named - self.not_visible, self.names - self.not_visible)

    @property
    def class_f1(self) -> float:
        """F1 of the classes: a cause is correct if its class has a true effect, a true effect is found if a class has it."""
        if self.said is None:
            return 0.0
        right = sum(bool(self.names & cause.members.keys()) for cause in self.said.causes)
        found = len(self.names & self.said.members)
        precision, recall = right / max(len(self.said.causes), 1), found / max(len(self.names), 1)
        return 2.0 * precision * recall / (precision + recall) if right else 0.0


def _f1(named: frozenset[str], true: frozenset[str]) -> float:
    """2 right / (named + true)."""
    return 2.0 * len(named & true) / max(len(named) + len(true), 1)
