"""The score of a folder of answers, each figure with its 95 % bounds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gtpin.bench.benchmark.answer import Answer
from gtpin.bench.benchmark.public_set import TRUTHS, PublicSet
from gtpin.bench.blind.judged import VISIBLE, Judged
from gtpin.bench.blind.score import Rate, mean, rate
from gtpin.bench.blind.truth import Truth, read_json
from gtpin.effects.catalogue import effects_by_id
from gtpin.errors import GtpinError
from gtpin.robot.library import load_robot
from gtpin.typing import Floats

SCHEMA = "gtpin-benchmark-score/1"
MISSING = "there is no answer"
SINGLE = ("one", "power")
"""Kinds of cases with one effect of the catalogue. Rough cases are left out: they can lack a column that the effect needs."""


@dataclass(frozen=True)
class Scored:
    """A case with its answer."""

    judged: Judged  # The truth, with D, and what the answer says
    # RMS error of the predictions at commands that are not in the dataset, in units of the instrument's noise; None if
    # not predicted
    error: float | None
    said: float | None  # The predicted explained fraction; None if not predicted

    def explained(self, before: float) -> float:
        """The explained fraction that is realised, for an error ``before`` of the geometry alone."""
        assert self.error is not None
        return 1.0 - (self.error / before) ** 2


def score_answers(
    public: PublicSet, folder: Path, answers: Path, names: Sequence[str] | None = None
) -> dict[str, Scored]:
    """Compare the answers ``NAME.json`` of a folder with the truths of a set that was made in ``folder``.

    A missing answer counts as wrong wherever it is counted. ``names``: only these cases.

    Raises `GtpinError` if a truth or an answer can't be read, an answer names an effect or a site that does not exist, or
    predictions have another shape.
    """
    wanted = list(public.cases) if names is None else list(names)
    if not any((answers / f"{name}.json").exists() for name in wanted):
        raise GtpinError("there are no answers here", file=answers, hint="it needs NAME.json for each case")
    return {name: _scored(public, folder, answers / f"{name}.json", name) for name in wanted}


def _scored(public: PublicSet, folder: Path, file: Path, name: str) -> Scored:
    published, truth = public.cases[name], read_json(folder / TRUTHS / f"{name}.json", Truth, "make the set anew")
    answer = Answer.read(file) if file.exists() else None
    if answer is not None:
        answer.check(file, _sites(public.robot(name)))
    effects = tuple(e.model_copy(update={"leaves": published.leaves}) for e in truth.effects)
    judged = Judged(
        name=name,
        kind=truth.kind,
        truth=effects if len(effects) == 1 else truth.effects,
        listed=all(effect.effect in effects_by_id() for effect in effects),
        said=answer.statement if answer else None,
        error=None if answer else MISSING,
    )
    if answer is None:
        return Scored(judged, None, None)
    squares = []
    if truth.poses is not None and answer.positions:
        assert truth.sigma is not None
        off = _shaped(answer.positions, truth.poses.T, file, "positions") - truth.poses.T
        squares.append(off / np.array(truth.sigma[:3]))
    for one in truth.readings:
        if one.name in answer.readings:
            true = np.array(one.values)
            squares.append((_shaped(answer.readings[one.name], true, file, one.name) - true) / np.array(one.sigma))
    error = float(np.sqrt(np.mean(np.concatenate([s.ravel() for s in squares]) ** 2))) if squares else None
    return Scored(judged, error, answer.explained_fraction)


@cache
def _sites(robot: str | None) -> dict[str, tuple[str, ...] | None]:
    """The sites of each effect of the catalogue at a robot; None for no robot."""
    found = None if robot is None else load_robot(robot)
    return {name: None if found is None else tuple(one.sites(found)) for name, one in effects_by_id().items()}


def _shaped(values: Sequence[Sequence[float]], true: Floats, file: Path, key: str) -> Floats:
    shape = (len(values), len(values[0]) if values else 0)
    if shape != true.shape or any(len(row) != shape[1] for row in values):
        what = f"{shape[0]} rows of {shape[1]} numbers in place of {true.shape[0]} of {true.shape[1]}"
        raise GtpinError(what, file=file, column=key, hint="predict each row of the commands, in their order")
    return np.array(values, dtype=float)


def figures(cases: Iterable[Scored]) -> dict[str, Rate]:
    """All figures, by their names; each over the cases for which it is defined."""
    scored = list(cases)
    every = [case.judged for case in scored]
    one = [c for c in every if c.kind in SINGLE]
    seen, clear = [c for c in one if c.noncentrality > VISIBLE], [c for c in one if c.leaves > VISIBLE]
    several = [c for c in every if c.kind in ("two", "three") and c.names - c.not_visible]
    none, unlisted = [c for c in every if c.kind == "none"], [c for c in every if c.kind == "unlisted"]
    errors = [case.error for case in scored if case.error]
    return {
        "one effect, E > 63: detected": rate(c.detected for c in seen),
        "one effect, E > 63: class holds the truth": rate(c.in_class for c in seen),
        "one effect, E > 63: members of the classes": mean(len(c.said.members) for c in seen if c.said and c.detected),
        "one effect, D > 63: strict": rate(c.strict for c in clear),
        "several effects: F1 of those with E > 63": mean(c.visible_f1 for c in several),
        "no effect: silent": rate(c.verdict == "none" for c in none),
        "unlisted effect: unknown": rate(c.verdict == "unknown" for c in unlisted),
        "unlisted effect: a false cause with confidence": rate(bool(c.false_confident) for c in unlisted),
        "all cases: a false cause with confidence": rate(bool(c.false_confident) for c in every),
        "all cases: a false cause named": rate(bool(c.false_names) for c in every),
        "error of prediction, units of the noise": geometric_mean(errors),
        "cases without an answer": rate(c.error is not None for c in every),
    }


def geometric_mean(values: Iterable[float]) -> Rate:
    """The geometric mean of positive values, with bounds of 1.96 standard errors of the logarithms."""
    found = mean(float(np.log(value)) for value in values)
    low, middle, high = (None if x is None else float(np.exp(x)) for x in (found.low, found.value, found.high))
    return Rate(middle, low, high, found.of)


def to_json(scored: dict[str, Scored]) -> dict[str, Any]:
    """The content of ``score.json``."""
    return {
        "schema": SCHEMA,
        "cases": len(scored),
        "figures": [{"figure": name, **asdict(found)} for name, found in figures(scored.values()).items()],
        "by_case": {
            name: {
                "kind": case.judged.kind,
                "truth": sorted(case.judged.names),
                "verdict": case.judged.verdict or None,
                "named": list(case.judged.said.names) if case.judged.said else [],
                "strict": case.judged.strict,
                "in_class": case.judged.in_class,
                "error": case.error,
            }
            for name, case in scored.items()
        },
    }
