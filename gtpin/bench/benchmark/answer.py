"""What a solver writes for a case: one small JSON file."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field

from gtpin.bench.blind.judged import Named, Statement
from gtpin.bench.blind.truth import read_json
from gtpin.errors import GtpinError

SCHEMA = "gtpin-answer/1"
Finite = Annotated[float, Field(allow_inf_nan=False)]
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
    positions: tuple[tuple[Finite, Finite, Finite], ...] = ()
    readings: dict[str, tuple[tuple[Finite, ...], ...]] = {}
    explained_fraction: Finite | None = None

    @staticmethod
    def read(file: Path) -> Answer:
        """The answer in a file. Raises GtpinError if the file can't be read, or is no answer."""
        found = read_json(file, Answer, "docs/benchmark.md has the keys")
        lists = {f"causes.{number}.class": cause.class_ for number, cause in enumerate(found.causes)}
        for key, named in {"causes": found.causes, **lists}.items():
            seen: set[str] = set()
            for number, one in enumerate(named):
                if one.name in seen:
                    what = f"{one.name[:100]} is named twice"
                    raise GtpinError(what, file=file, column=f"{key}.{number}", hint="keep one of them")
                seen.add(one.name)
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
