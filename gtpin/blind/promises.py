"""How far the gap was said to shrink, and how far it did."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from gtpin.blind.judged import Judged
from gtpin.blind.rates import Rate, mean, rate


@dataclass(frozen=True)
class Promise:
    """The shrinkage that was said, its interval, and what came true at held-out commands."""

    said: float
    interval: tuple[float, float] | None
    realised: float


def promises(cases: Iterable[Judged]) -> list[Promise]:
    """Of all cases but the weak ones that were made for the power, where anything was said."""
    return [
        Promise(c.said.shrinkage, c.said.interval, c.shrunk.share)
        for c in cases
        if c.said and c.shrunk and c.said.shrinkage is not None and c.kind != "power"
    ]


def off(told: Iterable[Promise]) -> Rate:
    """Mean absolute difference of what was said and what came true."""
    return mean(abs(promise.said - promise.realised) for promise in told)


def kept(told: Iterable[Promise]) -> Rate:
    """How often what came true lay in the interval."""
    return rate(p.interval[0] <= p.realised <= p.interval[1] for p in told if p.interval)
