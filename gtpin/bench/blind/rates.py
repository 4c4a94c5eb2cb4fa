"""Fractions and means with their 95 % bounds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest

Z = 1.959963984540054
"""Standard normal quantile of 0.975."""


@dataclass(frozen=True)
class Rate:
    """A fraction or mean over ``of`` cases, with its 95 % bounds; None where there are too few cases."""

    value: float | None
    low: float | None
    high: float | None
    of: int

    def to_json(self) -> dict[str, Any]:
        """``value``, ``low``, ``high``, ``of``."""
        return {"value": self.value, "low": self.low, "high": self.high, "of": self.of}


def rate(hits: Iterable[bool]) -> Rate:
    """Fraction of hits with Wilson's bounds (Wilson 1927, J. Am. Stat. Assoc. 22, 209)."""
    values = [bool(hit) for hit in hits]
    n = len(values)
    if not n:
        return Rate(None, None, None, 0)
    found = binomtest(sum(values), n)
    bounds = found.proportion_ci(method="wilson")
    return Rate(float(found.statistic), float(bounds.low), float(bounds.high), n)


def mean(values: Iterable[float]) -> Rate:
    """Mean with bounds of 1.96 standard errors; no bounds from a single value."""
    found = np.array(list(values), dtype=float)
    if not found.size:
        return Rate(None, None, None, 0)
    middle = float(found.mean())
    if found.size == 1:
        return Rate(middle, None, None, 1)
    half = Z * float(found.std(ddof=1)) / found.size**0.5
    return Rate(middle, middle - half, middle + half, int(found.size))
