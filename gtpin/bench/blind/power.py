"""Power curve: the fraction of effects that is detected, by their energy, compared with a matched filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gtpin.bench.blind.judged import Judged
from gtpin.bench.blind.rates import Rate, rate
from gtpin.distributions import norm

EDGES = (2.0, 8.0, 16.0, 32.0, 63.0, 125.0, 250.0)
"""Edges of the energy bins."""
FALSE_ALARM = 0.01


@dataclass(frozen=True)
class Found:
    """Fraction of effects that is detected, for a number of poses and a bin of E from ``start`` to ``end``.

    ``energy`` is the geometric mean of E in the bin, and ``limit`` the fraction that a matched filter detects.
    """

    poses: int
    start: float
    end: float
    energy: float
    found: Rate
    limit: float


def matched_filter(energy: float) -> float:
    """Detection probability of a filter that knows the effect's shape and sign, at 1 % false alarms; 95 % at E = 15.8."""
    return float(norm.sf(norm.isf(FALSE_ALARM) - np.sqrt(energy)))


def power(cases: Sequence[Judged], numbers: Sequence[int]) -> list[Found]:
    """Power curves of the cases of kind `power`, by number of poses and energy."""
    rows = []
    for number in numbers:
        for start, end in pairwise(EDGES):
            some = [c for c in cases if c.kind == "power" and c.planned == number and start <= c.energy < end]
            if some:
                limit = float(np.mean([matched_filter(c.energy) for c in some]))
                middle = float(np.exp(np.mean([np.log(c.energy) for c in some])))
                rows.append(Found(number, start, end, middle, rate(c.detected for c in some), limit))
    return rows
