"""The score by instrument, for checks in which other instruments than a tracker alone measured."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from gtpin.bench.blind.explained_fraction import absolute_error, explained_fractions
from gtpin.bench.blind.judged import VISIBLE, Judged
from gtpin.bench.blind.rates import Rate, mean, rate

SEVERAL = ("two", "three", "many")


def with_instruments(cases: Iterable[Judged]) -> bool:
    """Whether instruments of schema 2 measured some of the cases."""
    return any(case.instruments for case in cases)


def by_instrument(cases: Sequence[Judged]) -> dict[str, dict[str, Any]]:
    """By instruments: number of cases, of effects and of effects that are not visible, and rates with their bounds."""
    names = sorted({_name(case) for case in cases})
    return {name: _row([case for case in cases if _name(case) == name]) for name in names}


def not_visible(cases: Iterable[Judged]) -> dict[str, int]:
    """Number of the effects of the catalogue in cases with several (``effects``), and of those that are not visible."""
    several = [case for case in cases if case.kind in SEVERAL and case.listed]
    return {
        "effects": sum(len(case.names) for case in several),
        "not_visible": sum(len(case.not_visible) for case in several),
    }


def visible_f1(cases: Iterable[Judged]) -> Rate:
    """Mean F1 of the visible effects, over the cases with several effects of the catalogue of which one is visible."""
    several = [case for case in cases if case.kind in SEVERAL and case.listed]
    return mean(case.visible_f1 for case in several if case.names - case.not_visible)


def _row(cases: Sequence[Judged]) -> dict[str, Any]:
    one = [case for case in cases if case.kind == "one"]
    seen = [case for case in one if case.energy > VISIBLE]
    rates = {
        "detected": rate(case.detected for case in seen),
        "in_class": rate(case.in_class for case in seen),
        "strict": rate(case.strict for case in one if case.leaves > VISIBLE),
        "silent": rate(case.said is not None and not case.detected for case in cases if case.kind == "none"),
        "false_with_confidence": rate(bool(case.false_confident) for case in cases if case.kind),
        "set_f1_visible": visible_f1(cases),
        "shrinkage_error": absolute_error(explained_fractions(cases)),
    }
    return {"cases": len(cases), **not_visible(cases), **{name: found.to_json() for name, found in rates.items()}}


def _name(case: Judged) -> str:
    return " + ".join(case.instruments) if case.instruments else "tracker"
