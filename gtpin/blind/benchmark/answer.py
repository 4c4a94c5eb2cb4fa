"""What a solver writes for a case: one small JSON file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gtpin.blind.statement import Named, Statement
from gtpin.data.files import read_bytes
from gtpin.errors import GtpinError

SCHEMA = "gtpin-answer/1"
Finite = Annotated[float, Field(allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Word = Annotated[str, Field(min_length=1)]


class Member(BaseModel):
    """Another effect that a cause could be: its id and its site."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    effect: Word
    site: Word

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect}@{self.site}"


class AnsweredCause(Member):
    """A named cause.

    Parameters
    ----------
    probability
        Probability that it is a cause.
    class_
        What else the cause could be. The cause itself need not be listed.
    """

    probability: Share
    class_: Annotated[tuple[Member, ...], Field(alias="class")] = ()


class Answer(BaseModel):
    """The answer to one case.

    Parameters
    ----------
    causes
        The named causes, the most important first; empty where none is named.
    unknown
        Whether there is an effect that is in no catalogue.
    positions
        (H, 3) predicted positions of the TCP at ``commands.csv``, m, in its order; empty: not predicted.
    readings
        The same for each instrument of a dataset of schema 2, by its name: (H, c) readings at ``commands-NAME.csv``.
    explained_fraction
        Expected 1 - (a / b)^2, with a the RMS error of the predictions with the causes, and b that of the geometry alone;
        None: not predicted.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_: Annotated[str, Field(alias="schema", pattern=f"^{SCHEMA}$")] = SCHEMA
    causes: tuple[AnsweredCause, ...] = ()
    unknown: bool = False
    positions: tuple[tuple[Finite, Finite, Finite], ...] = ()
    readings: dict[str, tuple[tuple[Finite, ...], ...]] = {}
    explained_fraction: Finite | None = None

    @staticmethod
    def read(file: Path) -> Answer:
        """The answer in a file.

        Raises
        ------
        GtpinError
            If the file can't be read, or is no answer.
        """
        try:
            found = Answer.model_validate(json.loads(read_bytes(file).decode("utf-8-sig")))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            key = ".".join(str(part) for part in first["loc"])
            raise GtpinError(str(first["msg"]), file=file, column=key, hint="docs/benchmark.md has the keys") from None
        except (ValueError, RecursionError) as error:
            raise GtpinError(f"no JSON ({str(error)[:80]})", file=file, hint="correct the file") from None
        names = [cause.name for cause in found.causes]
        if twice := [name for name in names if names.count(name) > 1]:
            raise GtpinError(f"{twice[0]} is named twice", file=file, column="causes", hint="keep one of them")
        return found

    def write(self, file: Path) -> None:
        """Write the answer as JSON."""
        file.write_text(self.model_dump_json(by_alias=True, exclude_none=True) + "\n", encoding="utf-8")

    @property
    def statement(self) -> Statement:
        """The part of the answer that is scored as the causes and the verdict of a diagnosis."""
        causes = tuple(
            Named(
                name=cause.name,
                probability=cause.probability,
                members=dict.fromkeys((cause.name, *(member.name for member in cause.class_)), 0.0),
            )
            for cause in self.causes
        )
        if self.unknown:
            return Statement(verdict="unknown", causes=causes)
        return Statement(verdict="explained" if causes else "none", causes=causes)
