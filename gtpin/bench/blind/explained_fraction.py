"""Predicted and realised explained fraction of the gap (``shrinkage`` in the files)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from gtpin.bench.blind.judged import Judged
from gtpin.bench.blind.rates import Rate, mean, rate


@dataclass(frozen=True)
class ExplainedFraction:
    """The explained fraction that a diagnosis predicts, its interval, and the one realised at held-out commands."""

    predicted: float
    interval: tuple[float, float] | None
    realised: float


def explained_fractions(cases: Iterable[Judged]) -> list[ExplainedFraction]:
    """The explained fractions of all cases with a prediction, without the cases of kind `power`."""
    return [
        ExplainedFraction(c.said.shrinkage, c.said.interval, c.shrunk.share)
        for c in cases
        if c.said and c.shrunk and c.said.shrinkage is not None and c.kind != "power"
    ]


def absolute_error(fractions: Iterable[ExplainedFraction]) -> Rate:
    """Mean absolute difference of predicted and realised fraction."""
    return mean(abs(f.predicted - f.realised) for f in fractions)


def coverage(fractions: Iterable[ExplainedFraction]) -> Rate:
    """How often the realised fraction lies in the predicted interval."""
    return rate(f.interval[0] <= f.realised <= f.interval[1] for f in fractions if f.interval)
