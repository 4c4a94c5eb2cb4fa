"""The part of a diagnosis that is scored, read from ``diagnosis.json``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

CONFIDENT = 0.95
"""Smallest probability of a cause that is named with confidence."""


class Named(BaseModel):
    """A cause in the diagnosis: ``effect@site``, its probability, and the members of its class with their probabilities."""

    model_config = ConfigDict(frozen=True)

    name: str
    probability: float
    members: dict[str, float]
    parameters: dict[str, tuple[float, float]] = {}


class Statement(BaseModel):
    """The scored part of a diagnosis."""

    model_config = ConfigDict(frozen=True)

    # `verdict`, `causes`: As in ``diagnosis.json``; causes by ``effect@site``, the largest first
    verdict: Literal["none", "explained", "ambiguous", "unknown"]
    causes: tuple[Named, ...] = ()
    site: str = ""  # Site with the largest share in ``where``; empty if all shares are zero
    top: str = ""  # Candidate with the largest log evidence, ``effect@site``; empty without candidates
    # `shrinkage`, `interval`: As in ``diagnosis.json``; None if not given
    shrinkage: float | None = None
    interval: tuple[float, float] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Causes, ``effect@site``."""
        return tuple(cause.name for cause in self.causes)

    @property
    def members(self) -> frozenset[str]:
        """The classes of all causes together."""
        return frozenset(name for cause in self.causes for name in (cause.name, *cause.members))

    def confident(self) -> tuple[str, ...]:
        """Causes that are named with a probability of 0.95 or more."""
        return tuple(cause.name for cause in self.causes if cause.probability >= CONFIDENT)

    @staticmethod
    def of(diagnosis: Mapping[str, Any]) -> Statement:
        """Read the content of ``diagnosis.json``."""
        shares = diagnosis["where"]["site"]
        leading = max(shares, key=lambda site: shares[site], default="")
        candidates = [c for c in diagnosis["candidates"] if c["testable"]]
        top = max(candidates, key=lambda c: c["log_evidence"], default=None)
        gap = diagnosis["gap"]
        return Statement(
            verdict=diagnosis["verdict"],
            causes=tuple(
                Named(
                    name=_name(cause),
                    probability=cause["probability"],
                    members={_name(member): member["probability"] for member in cause["class"]},
                    parameters={k: (p["value"], p["sigma"]) for k, p in cause["parameters"].items()},
                )
                for cause in diagnosis["causes"]
            ),
            site=leading if leading and shares[leading] > 0.0 else "",
            top=_name(top) if top else "",
            shrinkage=gap["shrinkage"],
            interval=gap["interval"],
        )


def _name(record: Mapping[str, Any]) -> str:
    return f"{record['effect']}@{record['site']}"
