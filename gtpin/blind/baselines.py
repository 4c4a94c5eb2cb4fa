"""Baselines of a diagnosis: geometry alone, a Gaussian process, and naming the largest evidence without abstaining."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from gtpin.blind.figures import of_kind
from gtpin.blind.judged import VISIBLE, Judged, Shrunk
from gtpin.blind.rates import Rate, mean, rate
from gtpin.blind.statement import Named, Statement


def baselines(cases: Sequence[Judged]) -> dict[str, dict[str, Any]]:
    """Scores of the diagnosis and of its baselines, by the baseline's name and the figure's name."""
    return {
        "diagnosis": _row(cases, lambda shrunk: shrunk.after),
        "geometry only": _row([_silent(c) for c in cases], lambda shrunk: shrunk.before),
        "Gaussian process": _row([_silent(c) for c in cases], lambda shrunk: shrunk.smoothed),
        "largest score": _row([_largest_evidence(c) for c in cases], None),
        "knows the cause": _row([], lambda shrunk: shrunk.knowing, cases),
    }


def _row(
    cases: Sequence[Judged], after: Callable[[Shrunk], float | None] | None, others: Sequence[Judged] = ()
) -> dict[str, Any]:
    one = of_kind(cases, "one")
    outside = of_kind(cases, "unlisted")
    shares = [
        1.0 - (left / c.shrunk.before) ** 2
        for c in of_kind(cases or others, "one")
        if c.shrunk and after and c.shrunk.smoothed and c.shrunk.knowing and (left := after(c.shrunk)) is not None
    ]
    figures: dict[str, Rate] = {
        "strict": rate(c.strict for c in one if c.leaves > VISIBLE),
        "set_f1": mean(c.f1 for c in of_kind(cases, "two")),
        "false_alarm": rate(bool(c.said and c.said.causes) for c in of_kind(cases, "none")),
        "misnamed": rate(bool(c.false_names) for c in outside),
        "shrinkage": mean(shares),
    }
    return {name: found.to_json() for name, found in figures.items()}


def _silent(case: Judged) -> Judged:
    return case.model_copy(update={"said": Statement(verdict="none")})


def _largest_evidence(case: Judged) -> Judged:
    """The case with a diagnosis that always names the candidate with the largest evidence."""
    if case.said is None or not case.said.top:
        return _silent(case)
    named = Named(name=case.said.top, probability=1.0, members={case.said.top: 1.0})
    return case.model_copy(update={"said": Statement(verdict="explained", causes=(named,))})
