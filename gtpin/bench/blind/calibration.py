"""Reliability diagram: predicted probabilities against observed frequencies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from gtpin.bench.blind.judged import Judged
from gtpin.bench.blind.rates import Rate, rate

TENTHS = 10


@dataclass(frozen=True)
class Tenth:
    """Causes whose probability lies in one tenth: its lower edge, the mean probability, the fraction correct."""

    start: float
    predicted: float
    right: Rate


def tenths(cases: Iterable[Judged], members: bool = False) -> list[Tenth]:
    """The reliability of the named causes, or of all members of their classes; empty tenths are omitted."""
    found: list[list[tuple[float, bool]]] = [[] for _ in range(TENTHS)]
    for case in cases:
        for cause in case.said.causes if case.said and case.kind else ():
            probabilities = {cause.name: cause.probability} | (cause.members if members else {})
            for name, probability in probabilities.items():
                found[min(int(probability * TENTHS), TENTHS - 1)].append((probability, name in case.names))
    return [
        Tenth(i / TENTHS, sum(p for p, _ in some) / len(some), rate(right for _, right in some))
        for i, some in enumerate(found)
        if some
    ]
