"""The score of a check: fractions over all cases, figures with their targets, and further tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from gtpin.bench.blind.figures import (
    Rate,
    absolute_error,
    class_size,
    coverage,
    figures,
    mean,
    not_visible,
    of_kind,
    rate,
    taken_out,
    tenths,
    visible_f1,
    with_instruments,
)
from gtpin.bench.blind.judged import VISIBLE, Judged, Named, Shrunk, Statement
from gtpin.distributions import norm

SCHEMA = "gtpin-score/1"
POSES = (60, 120, 240)
EDGES = (2.0, 8.0, 16.0, 32.0, 63.0, 125.0, 250.0)
"""Edges of the power curve's bins of energy."""
FALSE_ALARM = 0.01


def score(cases: Sequence[Judged], about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The content of ``score.json``, with the settings ``about`` of the check; a fraction is None without cases for it."""
    one, none, unlisted = of_kind(cases, "one"), of_kind(cases, "none"), of_kind(cases, "unlisted")
    several = [c for c in of_kind(cases, "two", "three", "many") if c.listed]
    found = {
        "schema": SCHEMA,
        "cases": len(cases),
        "strict": rate(c.strict for c in one).value,
        "in_class": rate(c.in_class for c in one).value,
        "class_size": class_size(one).value,
        "site": rate(_site(c) for c in one).value,
        "false_alarm": rate(c.detected for c in none).value,
        "unknown_recognised": rate(c.verdict == "unknown" for c in unlisted).value,
        "unknown_misnamed": rate(bool(c.false_names) for c in unlisted).value,
        "set_f1": mean(c.f1 for c in several).value,
        "shrinkage_error": absolute_error(cases).value,
        "interval_coverage": coverage(cases).value,
        "failed": rate(c.error is not None for c in cases).value,
        "by_effect": by_effect(cases),
        "kinds": dict(sorted(Counter(c.kind or "broken seal" for c in cases).items())),
        "figures": [figure.to_json() for figure in figures(cases)],
        "baselines": baselines(cases),
        "confusion": confusion(one),
        "reliability": {
            name: [{"start": t.start, "said": t.predicted, "right": t.right.to_json()} for t in tenths(cases, members)]
            for name, members in (("causes", False), ("members", True))
        },
        "power": [asdict(found) for found in power(cases, POSES)],
        "check": dict(about or {}),
        "failures": [c.name for c in cases if c.error is not None],
    }
    if with_instruments(cases):
        found["set_f1_visible"] = visible_f1(cases).value
        found["not_visible"] = not_visible(cases)
        found["by_instrument"] = by_instrument(cases)
    return found


def by_effect(cases: Sequence[Judged]) -> dict[str, dict[str, Any]]:
    """By effect: cases, how often the diagnosis was correct, and what it was with the effect removed from the catalogue."""
    found: dict[str, dict[str, Any]] = {}
    one, taken = of_kind(cases, "one"), taken_out(cases)
    for effect in sorted({c.single.effect for c in one}):
        some = [c for c in one if c.single.effect == effect]
        out = [c for c in taken if c.single.effect == effect]
        strict, inside = rate(c.strict for c in some), rate(c.in_class for c in some)
        found[effect] = {
            "cases": len(some),
            "strict": strict.value,
            "in_class": inside.value,
            "strict_bounds": [strict.low, strict.high],
            "in_class_bounds": [inside.low, inside.high],
            "class_size": class_size(some).value,
            "detected": rate(c.detected for c in some).value,
            "site": rate(_site(c) for c in some).value,
            "where": rate(c.where for c in some).value,
            "taken_out": len(out),
            "taken_out_unknown": rate(c.verdict == "unknown" for c in out).value,
            "taken_out_misnamed": rate(bool(c.false_confident) for c in out).value,
        }
    return found


def _site(case: Judged) -> bool:
    """Whether the leading cause is at the true site."""
    return bool(case.said and case.said.names and case.said.names[0].split("@")[1] == case.single.site)


def by_instrument(cases: Sequence[Judged]) -> dict[str, dict[str, Any]]:
    """By instruments: number of cases, of effects and of effects that are not visible, and rates with their bounds."""
    by_name: dict[str, list[Judged]] = {}
    for case in cases:
        by_name.setdefault(" + ".join(case.instruments) if case.instruments else "tracker", []).append(case)
    found = {}
    for name, some in sorted(by_name.items()):
        one = of_kind(some, "one")
        seen = [case for case in one if case.noncentrality > VISIBLE]
        rates = {
            "detected": rate(case.detected for case in seen),
            "in_class": rate(case.in_class for case in seen),
            "strict": rate(case.strict for case in one if case.leaves > VISIBLE),
            "silent": rate(case.verdict == "none" for case in of_kind(some, "none")),
            "false_with_confidence": rate(bool(case.false_confident) for case in some if case.kind),
            "set_f1_visible": visible_f1(some),
            "shrinkage_error": absolute_error(some),
        }
        counts = {"cases": len(some), **not_visible(some)}
        found[name] = {**counts, **{key: value.to_json() for key, value in rates.items()}}
    return found


def confusion(one: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """Counts by true single effect (first key) and diagnosis: the leading cause's effect, or the verdict if there is none."""
    found: dict[str, Counter[str]] = {}
    for case in one:
        named = case.said.names if case.said else ("failed",)
        called = named[0].split("@")[0] if named else case.verdict
        found.setdefault(case.single.effect, Counter())[called] += 1
    return {effect: dict(sorted(found[effect].items())) for effect in sorted(found)}


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


def power(cases: Sequence[Judged], numbers: Sequence[int]) -> list[Found]:
    """Power curves of the cases of kind `power`, by number of poses and energy."""
    rows = []
    for number in numbers:
        for start, end in pairwise(EDGES):
            some = [c for c in of_kind(cases, "power") if c.planned == number and start <= c.noncentrality < end]
            if some:
                limit = float(np.mean([matched_filter(c.noncentrality) for c in some]))
                middle = float(np.exp(np.mean([np.log(c.noncentrality) for c in some])))
                rows.append(Found(number, start, end, middle, rate(c.detected for c in some), limit))
    return rows


def matched_filter(noncentrality: float) -> float:
    """Detection probability of a filter that knows the effect's shape and sign, at 1 % false alarms; 95 % at E = 15.8."""
    return float(norm.sf(norm.isf(FALSE_ALARM) - np.sqrt(noncentrality)))


def baselines(cases: Sequence[Judged]) -> dict[str, dict[str, Any]]:
    """Scores of the diagnosis and of its baselines, by the baseline's name and the figure's name."""
    silent = [_naming(c, "") for c in cases]
    largest = [_naming(c, c.said.top if c.said else "") for c in cases]
    return {
        "diagnosis": _row(cases, cases, lambda shrunk: shrunk.after),
        "geometry only": _row(silent, cases, lambda shrunk: shrunk.before),
        "Gaussian process": _row(silent, cases, lambda shrunk: shrunk.smoothed),
        "largest score": _row(largest, cases, None),
        "knows the cause": _row([], cases, lambda shrunk: shrunk.knowing),
    }


def _row(
    cases: Sequence[Judged], every: Sequence[Judged], after: Callable[[Shrunk], float | None] | None
) -> dict[str, Any]:
    """Figures of a baseline: of the causes that it names in ``cases``, and of its errors in all of them."""
    shares = [
        1.0 - (left / c.shrunk.before) ** 2
        for c in of_kind(every, "one")
        if c.shrunk and after and c.shrunk.smoothed and c.shrunk.knowing and (left := after(c.shrunk)) is not None
    ]
    found = {
        "strict": rate(c.strict for c in of_kind(cases, "one") if c.leaves > VISIBLE),
        "set_f1": mean(c.f1 for c in of_kind(cases, "two")),
        "false_alarm": rate(bool(c.said and c.said.causes) for c in of_kind(cases, "none")),
        "misnamed": rate(bool(c.false_names) for c in of_kind(cases, "unlisted")),
        "shrinkage": mean(shares),
    }
    return {name: one.to_json() for name, one in found.items()}


def _naming(case: Judged, name: str) -> Judged:
    """The case with a diagnosis that names one cause, or nothing where the name is empty."""
    causes = (Named(name=name, probability=1.0, members={name: 1.0}),) if name else ()
    return case.model_copy(update={"said": Statement(verdict="explained" if name else "none", causes=causes)})
