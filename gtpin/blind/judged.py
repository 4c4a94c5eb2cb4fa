"""A case after its seal was opened: what is true, and what was said."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from gtpin.blind.statement import Statement
from gtpin.blind.truth import Hidden, Kind

VISIBLE = 63.0
"""E and D from which an effect must be found, and named (four times what a matched filter needs)."""
LEFT = 250.0
"""What known effects must leave of an unknown one for it to be seen as unknown."""


class Shrunk(BaseModel):
    """How far the gap shrank at held-out commands, against the true poses.

    Parameters
    ----------
    before, after
        Root mean square length of the position error, m, of the geometry alone, and with the causes that were named.
    knowing
        The same of a fit that knows the causes; None where there is none.
    smoothed
        The same of a Gaussian process that names nothing; None where it was not tried.
    """

    model_config = ConfigDict(frozen=True)

    before: float
    after: float
    knowing: float | None = None
    smoothed: float | None = None

    @property
    def share(self) -> float:
        """Of the gap's power, what went away."""
        return 1.0 - (self.after / self.before) ** 2 if self.before > 0.0 else 0.0


class Judged(BaseModel):
    """A case, its truth, and what was said of it.

    Parameters
    ----------
    kind
        What sort of case it is; None where its seal was broken.
    poses, planned
        Rows of the dataset, and different commands among them.
    truth
        Its effects, with E and D, displacements left out.
    rival
        The wrong effect that leaves least of a single one.
    listed
        Whether all its effects are in the catalogue.
    testable
        Whether the dataset has what its known effects need.
    error
        Why it failed.
    said
        None where it failed.
    left
        What the named class's members, and the true effect in its textbook form, leave of a single effect.
    without, without_error, without_left
        What was said once a single effect was taken out of the catalogue, or why that failed, and what the best of the
        others leaves of it.
    shrunk
        None without true poses or where it failed.
    parameters
        Name, value, sigma and true value of the parameters of causes that were rightly named.
    """

    model_config = ConfigDict(frozen=True)

    name: str
    kind: Kind | None = None
    poses: int = 0
    planned: int = 0
    truth: tuple[Hidden, ...] = ()
    rival: str = ""
    listed: bool = True
    testable: bool = True
    error: str | None = None
    said: Statement | None = None
    left: dict[str, float] = {}
    without: Statement | None = None
    without_error: str | None = None
    without_left: float | None = None
    shrunk: Shrunk | None = None
    parameters: tuple[tuple[str, float, float, float], ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """What is true, ``effect@site``."""
        return frozenset(effect.name for effect in self.truth)

    @property
    def single(self) -> Hidden:
        """The effect of a case that has one."""
        (effect,) = self.truth
        return effect

    @property
    def energy(self) -> float:
        """E of a single effect; NaN where it is not known."""
        return float("nan") if self.single.energy is None else self.single.energy

    @property
    def leaves(self) -> float:
        """D of a single effect; NaN where it is not known."""
        return float("nan") if self.single.leaves is None else self.single.leaves

    @property
    def detected(self) -> bool:
        """Whether anything was seen."""
        return self.said is not None and self.said.verdict != "none"

    @property
    def strict(self) -> bool:
        """Whether exactly what is true was named, and no unknown beside it."""
        return self.said is not None and self.said.verdict != "unknown" and frozenset(self.said.names) == self.names

    @property
    def in_class(self) -> bool:
        """Whether the classes hold all that is true."""
        return self.said is not None and bool(self.names) and self.names <= self.said.members

    @property
    def false_names(self) -> tuple[str, ...]:
        """Causes named that are none."""
        return tuple(n for n in self.said.names if n not in self.names) if self.said else ()

    @property
    def false_confident(self) -> tuple[str, ...]:
        """Causes named with confidence that are none."""
        return tuple(n for n in self.said.confident() if n not in self.names) if self.said else ()

    @property
    def f1(self) -> float:
        """F1 of the set of causes: 2 right / (named + true)."""
        named = frozenset(self.said.names) if self.said else frozenset()
        return 2.0 * len(named & self.names) / max(len(named) + len(self.names), 1)

    @property
    def class_f1(self) -> float:
        """F1 of the classes: a cause is right whose class holds a true one, and a true one is found that a class holds."""
        if self.said is None:
            return 0.0
        right = sum(bool(self.names & cause.members.keys()) for cause in self.said.causes)
        found = len(self.names & self.said.members)
        precision, recall = right / max(len(self.said.causes), 1), found / max(len(self.names), 1)
        return 2.0 * precision * recall / (precision + recall) if right else 0.0
