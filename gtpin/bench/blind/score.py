"""The score of a check: fractions over all cases, figures with their targets, and further tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from gtpin.bench.blind.figures import (
    Tenth,
    absolute_error,
    by_instrument,
    coverage,
    explained_fractions,
    figures,
    not_visible,
    of_kind,
    taken_out,
    tenths,
    visible_f1,
    with_instruments,
)
from gtpin.bench.blind.judged import VISIBLE, Judged, Shrunk
from gtpin.bench.blind.rates import Rate, mean, rate
from gtpin.bench.blind.statement import Named, Statement
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


SCHEMA = "gtpin-score/1"
POSES = (60, 120, 240)


def score(cases: Sequence[Judged], about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The content of ``score.json``; a fraction is None if there are no cases for it.

    Parameters
    ----------
    about
        Settings of the check, to be recorded.
    """
    one = of_kind(cases, "one")
    several = [c for c in of_kind(cases, "two", "three", "many") if c.listed]
    none, unlisted = of_kind(cases, "none"), of_kind(cases, "unlisted")
    fractions = explained_fractions(cases)
    return {
        "schema": SCHEMA,
        "cases": len(cases),
        "strict": rate(c.strict for c in one).value,
        "in_class": rate(c.in_class for c in one).value,
        "class_size": mean(len(c.said.members) for c in one if c.said and c.said.members).value,
        "site": rate(_site(c) for c in one).value,
        "false_alarm": rate(c.detected for c in none).value,
        "unknown_recognised": rate(c.said is not None and c.said.verdict == "unknown" for c in unlisted).value,
        "unknown_misnamed": rate(bool(c.false_names) for c in unlisted).value,
        "set_f1": mean(c.f1 for c in several).value,
        "shrinkage_error": absolute_error(fractions).value,
        "interval_coverage": coverage(fractions).value,
        "failed": rate(c.error is not None for c in cases).value,
        "by_effect": by_effect(cases),
        "kinds": dict(sorted(Counter(c.kind or "broken seal" for c in cases).items())),
        "figures": [figure.to_json() for figure in figures(cases)],
        "baselines": baselines(cases),
        "confusion": confusion(one),
        "reliability": {
            "causes": [_tenth(t) for t in tenths(cases)],
            "members": [_tenth(t) for t in tenths(cases, members=True)],
        },
        "power": [asdict(found) for found in power(cases, POSES)],
        "check": dict(about or {}),
        "failures": [c.name for c in cases if c.error is not None],
        **(_of_instruments(cases) if with_instruments(cases) else {}),
    }


def _of_instruments(cases: Sequence[Judged]) -> dict[str, Any]:
    """Additional keys of a score where other instruments than a tracker alone measured."""
    return {
        "set_f1_visible": visible_f1(cases).value,
        "not_visible": not_visible(cases),
        "by_instrument": by_instrument(cases),
    }


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
            "class_size": mean(len(c.said.members) for c in some if c.said and c.said.members).value,
            "detected": rate(c.detected for c in some).value,
            "site": rate(_site(c) for c in some).value,
            "where": rate(c.said is not None and c.said.site == c.single.site for c in some).value,
            "taken_out": len(out),
            "taken_out_unknown": rate(c.said is not None and c.said.verdict == "unknown" for c in out).value,
            "taken_out_misnamed": rate(bool(c.false_confident) for c in out).value,
        }
    return found


def confusion(one: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """Counts by true single effect (first key) and diagnosis: the leading cause's effect, or the verdict if there is none."""
    found: dict[str, Counter[str]] = {}
    for case in one:
        found.setdefault(case.single.effect, Counter())[_called(case)] += 1
    return {effect: dict(sorted(found[effect].items())) for effect in sorted(found)}


def _called(case: Judged) -> str:
    if case.said is None:
        return "failed"
    return case.said.names[0].split("@")[0] if case.said.names else case.said.verdict


def _site(case: Judged) -> bool:
    """Whether the leading cause is at the true site."""
    return bool(case.said and case.said.names and case.said.names[0].split("@")[1] == case.single.site)


def _tenth(tenth: Tenth) -> dict[str, Any]:
    return {"start": tenth.start, "said": tenth.predicted, "right": tenth.right.to_json()}


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
