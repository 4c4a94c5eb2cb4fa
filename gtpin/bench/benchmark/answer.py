"""What a solver writes for a case, one small JSON file; and the score of a folder of them, with 95 % bounds."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from gtpin.bench.benchmark.public_set import TRUTHS, PublicSet
from gtpin.bench.blind.judged import VISIBLE, Judged, Named, Statement
from gtpin.bench.blind.score import Rate, mean, rate
from gtpin.bench.blind.truth import Finite, Triple, Truth, read_json
from gtpin.effects.catalogue import effects_by_id
from gtpin.errors import GtpinError
from gtpin.robot.library import load_robot
from gtpin.typing import Floats

SCHEMA = "gtpin-answer/1"
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Word = Annotated[str, Field(min_length=1)]


class OtherEffect(BaseModel, frozen=True, extra="forbid"):
    """Another effect that a cause could be: its id and its site."""

    effect: Word
    site: Word

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect}@{self.site}"


class AnsweredCause(OtherEffect, frozen=True):
    """A named cause.

    ``probability``: probability that it is a cause. ``class_``: what else the cause could be. The cause itself need not be
    listed.
    """

    probability: Share
    class_: Annotated[tuple[OtherEffect, ...], Field(alias="class")] = ()


class Answer(BaseModel, frozen=True, extra="forbid"):
    """The answer to one case.

    - ``causes``: the named causes, the most important first; empty where none is named.
    - ``unknown``: whether there is an effect that is in no catalogue.
    - ``positions``: (H, 3) predicted positions of the TCP at ``commands.csv``, m, in its order; empty: not predicted.
    - ``readings``: the same for each instrument of a dataset of schema 2, by its name: (H, c) readings at
      ``commands-NAME.csv``.
    - ``explained_fraction``: expected 1 - (a / b)^2, with a the RMS error of the predictions with the causes, and b that of
      the geometry alone; None: not predicted.
    """

    schema_: Annotated[str, Field(alias="schema", pattern=f"^{SCHEMA}$")] = SCHEMA
    causes: tuple[AnsweredCause, ...] = ()
    unknown: bool = False
    positions: tuple[Triple, ...] = ()
    readings: dict[str, tuple[tuple[Finite, ...], ...]] = {}
    explained_fraction: Finite | None = None

    @staticmethod
    def read(file: Path) -> Answer:
        """The answer in a file. Raises GtpinError if the file can't be read, or is no answer."""
        found = read_json(file, Answer, "docs/benchmark.md has the keys")
        lists = {
            f"causes.{number}.class": [one.name for one in cause.class_] for number, cause in enumerate(found.causes)
        }
        for key, names in {"causes": [cause.name for cause in found.causes], **lists}.items():
            for number, name in enumerate(names):
                if name in names[:number]:
                    what = f"{name[:100]} is named twice"
                    raise GtpinError(what, file=file, column=f"{key}.{number}", hint="keep one of them")
        return found

    def check(self, file: Path, sites: Mapping[str, Sequence[str] | None]) -> None:
        """Check that the answer names effects of the catalogue at sites that the machine has.

        ``sites``: of each effect; None where they are not known. A misspelt effect would count as a wrong one.

        Raises `GtpinError` if an effect or a site does not exist, with its key.
        """
        for number, cause in enumerate(self.causes):
            keys = [f"causes.{number}", *(f"causes.{number}.class.{i}" for i in range(len(cause.class_)))]
            for key, one in zip(keys, (cause, *cause.class_), strict=True):
                if one.effect not in sites:
                    near = difflib.get_close_matches(one.effect[:100], list(sites), n=1)
                    hint = f"did you mean {near[0]}?" if near else f"effects are {', '.join(sites)}"
                    what = f"no effect is called {one.effect[:100]!r}"
                    raise GtpinError(what, file=file, column=f"{key}.effect", hint=hint)
                places = sites[one.effect]
                if places is not None and one.site not in places:
                    what = f"{one.effect} can't be at {one.site[:100]!r}"
                    raise GtpinError(what, file=file, column=f"{key}.site", hint=f"use {', '.join(places) or 'none'}")

    def write(self, file: Path) -> None:
        """Write the answer as JSON."""
        file.write_text(self.model_dump_json(by_alias=True, exclude_none=True) + "\n", encoding="utf-8")

    @property
    def statement(self) -> Statement:
        """The part of the answer that is scored as the causes and the verdict of a diagnosis."""
        causes = []
        for cause in self.causes:
            members = dict.fromkeys((cause.name, *(member.name for member in cause.class_)), 0.0)
            causes.append(Named(name=cause.name, probability=cause.probability, members=members))
        verdict = "unknown" if self.unknown else "explained" if causes else "none"
        return Statement.model_validate({"verdict": verdict, "causes": causes})


SCORE_SCHEMA = "gtpin-benchmark-score/1"


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
        error=None if answer else "there is no answer",
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
    one = [c for c in every if c.kind in ("one", "power")]  # rough ones can lack a column that the effect needs
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
        "schema": SCORE_SCHEMA,
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
