"""Splits causes into certain and ambiguous ones."""

from __future__ import annotations

from collections.abc import Iterable

from gtpin.diagnosis.inference.findings import Cause

SURE = 0.95
"""Smallest probability of a certain cause."""


def sure_and_doubtful(causes: Iterable[Cause]) -> tuple[list[Cause], list[Cause]]:
    """The certain causes, and the others."""
    found = list(causes)
    return [c for c in found if c.probability >= SURE], [c for c in found if c.probability < SURE]
