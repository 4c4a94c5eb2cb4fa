"""Which causes are sure enough to stand alone."""

from __future__ import annotations

from collections.abc import Iterable

from gtpin.diagnosis.inference.findings import Cause

SURE = 0.95
"""Probability from which a cause stands alone."""


def sure_and_doubtful(causes: Iterable[Cause]) -> tuple[list[Cause], list[Cause]]:
    """The causes that stand alone, and the others."""
    found = list(causes)
    return [c for c in found if c.probability >= SURE], [c for c in found if c.probability < SURE]
