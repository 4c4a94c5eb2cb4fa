"""The score of a check: fractions over all cases, figures with their targets, and further tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import binomtest

from gtpin.bench.blind.judged import LEFT, VISIBLE, Judged
from gtpin.bench.blind.truth import Kind
from gtpin.distributions import norm

Z = 1.959963984540054
"""Standard normal quantile of 0.975."""


@dataclass(frozen=True)
class Rate:
    """A fraction or mean over ``of`` cases, with its 95 % bounds; None where there are too few cases."""

    value: float | None
    low: float | None
    high: float | None
    of: int


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


TENTHS = 10
STATED = (0.5, 0.9, 0.99)
"""Probabilities at which risk and coverage are given."""
LEAST_GIVEN = 1e-3
"""Smallest probability of what is true that the log score takes: a certain false cause counts as 6.9 nats."""
SEVERAL: tuple[Kind, ...] = ("two", "three", "many")


def of_kind(cases: Iterable[Judged], *kinds: Kind) -> list[Judged]:
    """The cases of some kinds."""
    return [case for case in cases if case.kind in kinds]


def taken_out(cases: Iterable[Judged]) -> list[Judged]:
    """Cases with one effect as cases with an unlisted effect: diagnosed with the effect removed from the catalogue."""
    found = []
    for case in of_kind(cases, "one"):
        if case.without is not None or case.without_error is not None:
            nameless = case.single.model_copy(update={"site": "", "leaves": case.without_left})
            update = {"said": case.without, "error": case.without_error, "truth": (nameless,)}
            found.append(case.model_copy(update=update))
    return found


def class_size(cases: Iterable[Judged]) -> Rate:
    """Mean number of members of the classes, where a cause is named."""
    return mean(len(c.said.members) for c in cases if c.said and c.said.members)


def overstated(cases: Iterable[Judged]) -> list[float]:
    """Predicted less realised explained fraction of all cases that have both, without the cases of kind `power`."""
    return [c.overstated for c in cases if c.overstated is not None and c.kind != "power"]


def absolute_error(cases: Iterable[Judged]) -> Rate:
    """Mean absolute difference of predicted and realised fraction."""
    return mean(map(abs, overstated(cases)))


def coverage(cases: Iterable[Judged]) -> Rate:
    """How often the realised fraction lies in the predicted interval."""
    return rate(
        c.said.interval[0] <= c.shrunk.share <= c.said.interval[1]
        for c in cases
        if c.said and c.shrunk and c.said.interval and c.overstated is not None and c.kind != "power"
    )


def tenths(cases: Iterable[Judged], members: bool = False) -> list[tuple[float, float, Rate]]:
    """The reliability of the named causes, or of all members of their classes, by tenths of the probability: lower edge, mean
    probability, and the fraction correct; empty tenths are omitted."""
    found: list[list[tuple[float, bool]]] = [[] for _ in range(TENTHS)]
    for case in cases:
        for cause in case.said.causes if case.said and case.kind else ():
            probabilities = {cause.name: cause.probability} | (cause.members if members else {})
            for name, probability in probabilities.items():
                found[min(int(probability * TENTHS), TENTHS - 1)].append((probability, name in case.names))
    return [
        (i / TENTHS, sum(p for p, _ in some) / len(some), rate(right for _, right in some))
        for i, some in enumerate(found)
        if some
    ]


def stated(cases: Iterable[Judged]) -> list[tuple[float, bool]]:
    """Probability of each named cause, and whether it is true."""
    named = ((case, cause) for case in cases if case.said and case.kind for cause in case.said.causes)
    return [(cause.probability, cause.name in case.names) for case, cause in named]


def with_instruments(cases: Iterable[Judged]) -> bool:
    """Whether instruments of schema 2 measured some of the cases."""
    return any(case.instruments for case in cases)


def not_visible(cases: Iterable[Judged]) -> dict[str, int]:
    """Number of the effects of the catalogue in cases with several (``effects``), and of those that are not visible."""
    several = [case for case in of_kind(cases, *SEVERAL) if case.listed]
    hidden = sum(len(case.not_visible) for case in several)
    return {"effects": sum(len(case.names) for case in several), "not_visible": hidden}


def visible_f1(cases: Iterable[Judged]) -> Rate:
    """Mean F1 of the visible effects, over the cases with several effects of the catalogue of which one is visible."""
    several = [case for case in of_kind(cases, *SEVERAL) if case.listed]
    return mean(case.visible_f1 for case in several if case.names - case.not_visible)


@dataclass(frozen=True)
class Figure:
    """One figure: its name, its value with bounds, and its target, the smallest or largest accepted value."""

    name: str
    rate: Rate
    least: float | None = None
    most: float | None = None

    @property
    def reached(self) -> bool | None:
        """Whether the value reaches its target; None without cases or target."""
        value = self.rate.value
        if value is None or (self.least is None and self.most is None):
            return None
        return (self.least is None or value >= self.least) and (self.most is None or value <= self.most)

    def to_json(self) -> dict[str, Any]:
        """As in ``score.json``."""
        target = {"least": self.least, "most": self.most, "reached": self.reached}
        return {"figure": self.name, **asdict(self.rate), **target}


def figures(cases: Sequence[Judged]) -> list[Figure]:
    """All figures; a failed case counts as incorrect."""
    one, none, two = of_kind(cases, "one"), of_kind(cases, "none"), of_kind(cases, "two")
    seen, clear = [c for c in one if c.noncentrality > VISIBLE], [c for c in one if c.leaves > VISIBLE]
    weak = [c for c in one if c.leaves <= VISIBLE]
    fair = [c for c in of_kind(cases, "rough") if len(c.truth) == 1 and c.testable and c.listed]
    rough = rate(c.in_class for c in fair if c.noncentrality > VISIBLE)
    plain = [c for c in two if all((effect.energy or 0.0) > VISIBLE for effect in c.truth)]
    both, three = of_kind(cases, "known_and_unlisted"), of_kind(cases, "three")
    right = "cause and site right, nothing else named, D > 63"
    confident = rate(not c.error and not c.false_confident for c in weak)
    covered = (abs(value - true) <= 1.96 * sigma for c in cases for _, value, sigma, true in c.parameters)
    reliable = [(said, right.value) for _, said, right in tenths(cases) if right.of >= 30]
    off = [abs(said - right) for said, right in reliable if right is not None]
    farthest = Rate(max(off, default=None), None, None, len(off))
    # A member of the class that does not fit the true effect.
    others = ((c.left, c.said.members - c.names if c.said else ()) for c in seen)
    wrong = rate(any(left.get(name, 0.0) > VISIBLE for name in members) for left, members in others)
    # Where the instruments can't show all effects, F1 of the visible ones has the target.
    whole = Figure("two effects: F1 of the set", mean(c.f1 for c in two), least=0.95)
    sets = [whole]
    if with_instruments(cases):
        visible = Figure("two effects: F1 of those with E > 63", visible_f1(two), least=0.95)
        sets = [Figure(whole.name, whole.rate), visible]
    return [
        Figure("detected, E > 63", rate(c.detected for c in seen), least=0.97),
        Figure("class holds the truth, E > 63", rate(c.in_class for c in seen), least=0.97),
        Figure("members of the class, E > 63", class_size(seen), most=2.5),
        Figure("class with a member that leaves more than 63, E > 63", wrong, most=0.0),
        Figure(right, rate(c.strict for c in clear), least=0.90),
        Figure("site that leads where right, D > 63", rate(c.where for c in clear), least=0.90),
        Figure("no false name with confidence, D <= 63", confident, least=0.95),
        Figure("no effect: silent", rate(c.verdict == "none" for c in none), least=0.99),
        *sets,
        Figure("two effects, E > 63 of each: F1 of the set", mean(c.f1 for c in plain), least=0.95),
        Figure("two effects, E > 63 of each: F1 of the classes", mean(c.class_f1 for c in plain)),
        Figure("three effects: F1 of the set", mean(c.f1 for c in three)),
        *_outside("outside the catalogue", of_kind(cases, "unlisted")),
        *_outside("taken out of the catalogue", taken_out(cases)),
        Figure("known and unlisted together: unknown", rate(c.verdict == "unknown" for c in both)),
        Figure("known and unlisted together: a false cause named", rate(bool(c.false_names) for c in both)),
        Figure("probabilities: farthest off of the tenths that have 30 causes", farthest, most=0.05),
        *proper_scores(cases),
        Figure("rough data: class holds the truth, E > 63, covariate there", rough, least=0.90),
        Figure("shrinkage said less realised, absolute", absolute_error(cases), most=0.05),
        Figure("shrinkage said less realised", mean(overstated(cases))),
        Figure("95 % interval of shrinkage covers", coverage(cases), least=0.90),
        Figure("95 % intervals of parameters cover", rate(covered)),
    ]


def proper_scores(cases: Sequence[Judged]) -> list[Figure]:
    """Brier score and log score of the named causes, and risk against coverage.

    The risk at a probability is the share of false ones among the causes that are stated with it or more. The coverage is the
    share of the visible single effects for which a cause is stated so. Source: Gneiting and Raftery 2007, J. Am. Stat. Assoc.
    102, 359.
    """
    every = stated(cases)
    given = [probability if right else 1.0 - probability for probability, right in every]
    found = [
        Figure("Brier score of the named causes", mean((1.0 - p) ** 2 for p in given)),
        Figure("log score of the named causes, nats", mean(-np.log(max(p, LEAST_GIVEN)) for p in given)),
    ]
    single = [c for c in of_kind(cases, "one") if c.noncentrality > VISIBLE]
    for least in STATED:
        sure = [right for probability, right in every if probability >= least]
        said = (any(cause.probability >= least for cause in c.said.causes) if c.said else False for c in single)
        found.append(Figure(f"risk of causes of {least} or more", rate(not right for right in sure)))
        found.append(Figure(f"coverage of causes of {least} or more, one effect, E > 63", rate(said)))
    return found


def _outside(word: str, cases: Sequence[Judged]) -> list[Figure]:
    """Figures of effects that are not in the catalogue."""
    plain, where = [c for c in cases if c.leaves > LEFT], "where others leave more than 250"
    confident = [rate(bool(c.false_confident) for c in some) for some in (plain, cases)]
    return [
        Figure(f"{word}: unknown, {where}", rate(c.verdict == "unknown" for c in plain), least=0.90),
        Figure(f"{word}: unknown, all", rate(c.verdict == "unknown" for c in cases)),
        Figure(f"{word}: a cause named with confidence, {where}", confident[0], most=0.15),
        Figure(f"{word}: a cause named with confidence, all", confident[1], most=0.15),
        Figure(f"{word}: any cause named, all", rate(bool(c.false_names) for c in cases)),
    ]


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
        "confusion": confusion(one),
        "reliability": {
            name: [{"start": a, "said": said, "right": asdict(right)} for a, said, right in tenths(cases, members)]
            for name, members in (("causes", False), ("members", True))
        },
        "power": power(cases, POSES),
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
        found[name] = {**counts, **{key: asdict(value) for key, value in rates.items()}}
    return found


def confusion(one: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """Counts by true single effect (first key) and diagnosis: the leading cause's effect, or the verdict if there is none."""
    found: dict[str, Counter[str]] = {}
    for case in one:
        named = case.said.names if case.said else ("failed",)
        called = named[0].split("@")[0] if named else case.verdict
        found.setdefault(case.single.effect, Counter())[called] += 1
    return {effect: dict(sorted(found[effect].items())) for effect in sorted(found)}


def power(cases: Sequence[Judged], numbers: Sequence[int]) -> list[dict[str, Any]]:
    """Power curves of the cases of kind `power`, by number of ``poses`` and bin of E from ``start`` to ``end``.

    ``energy`` is the geometric mean of E in the bin, ``found`` the rate of detection, and ``limit`` that of a matched filter.
    """
    rows = []
    for number in numbers:
        for start, end in pairwise(EDGES):
            some = [c for c in of_kind(cases, "power") if c.planned == number and start <= c.noncentrality < end]
            if some:
                limit = float(np.mean([matched_filter(c.noncentrality) for c in some]))
                middle = float(np.exp(np.mean([np.log(c.noncentrality) for c in some])))
                found = asdict(rate(c.detected for c in some))
                edges = {"poses": number, "start": start, "end": end}
                rows.append({**edges, "energy": middle, "found": found, "limit": limit})
    return rows


def matched_filter(noncentrality: float) -> float:
    """Detection probability of a filter that knows the effect's shape and sign, at 1 % false alarms; 95 % at E = 15.8."""
    return float(norm.sf(norm.isf(FALSE_ALARM) - np.sqrt(noncentrality)))
