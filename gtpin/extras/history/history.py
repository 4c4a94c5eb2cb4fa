"""A log of checks over time: one line of JSON for each check, in a file to which lines are only added."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gtpin.data import Dataset
from gtpin.data.files import read_text
from gtpin.diagnosis.result import HealthCheck, Verdict
from gtpin.errors import GtpinError
from gtpin.output.results import fields

SCHEMA: Final = "gtpin-history/1"
Finite = Annotated[float, Field(allow_inf_nan=False)]


def refuse_readings(dataset: Dataset) -> None:
    """Raise `DatasetError` unless a check is by the poses of one tracker: a history has position errors."""
    what = "a history has position errors, and these are readings of other instruments"
    dataset.refuse_readings(what, "leave --history out")


class HistoryPart(BaseModel):
    """The base class of the parts of a line. Unknown keys, and text in place of numbers, are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, populate_by_name=True, frozen=True, defer_build=True)


class Changed(HistoryPart):
    """A change that a check named: the leader of its class, with its probability, and value and unit of its first parameter."""

    effect: str
    site: str
    probability: Finite
    parameter: str
    value: Finite
    unit: str


class Entry(HistoryPart):
    """One check. Lengths in m; ``date`` is UTC, as in ISO 8601."""

    schema_: Literal["gtpin-history/1"] = Field(alias="schema", default=SCHEMA)
    date: str
    robot: str
    dataset: str
    poses: int
    verdict: Verdict
    position_rms: Finite
    noise_floor: Finite
    changes: list[Changed]

    @staticmethod
    def of(check: HealthCheck, now: datetime) -> Entry:
        """The line of a check that was made at the time ``now``.

        Raises `GtpinError` if it is a check by readings, which have no position errors.
        """
        refuse_readings(check.dataset)
        changes = []
        for c in check.causes:
            name, e = next(iter(c.parameters.items()))
            first = {"parameter": name, "value": e.value, "unit": e.unit}
            changes.append(Changed.model_validate(fields(c, "effect", "site", "probability") | first))
        return Entry(
            date=now.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
            robot=check.baseline.robot.name,
            dataset="" if check.dataset.path is None else str(check.dataset.path),
            poses=check.poses,
            verdict=check.verdict,
            position_rms=check.gap.before,
            noise_floor=check.gap.floor,
            changes=changes,
        )

    @property
    def time(self) -> datetime:
        """``date`` as a `datetime`, UTC."""
        return datetime.strptime(self.date, "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=UTC)


@dataclass(frozen=True)
class HistoryFiles:
    """The files of a history: a folder, and the names of the file of lines (JSON) and of the page (HTML) in it."""

    folder: Path
    lines: str
    page: str

    @staticmethod
    def named(path: Path) -> HistoryFiles:
        """The files of ``FILE.html``, with the lines in ``FILE.jsonl``; or of a folder, with ``history.html`` and its lines."""
        if path.suffix == ".html":
            return HistoryFiles(path.parent, f"{path.stem}.jsonl", path.name)
        return HistoryFiles(path, "history.jsonl", "history.html")

    @property
    def names(self) -> tuple[str, str]:
        """Names of the two files: the lines, then the page."""
        return self.lines, self.page


def read_history(files: HistoryFiles) -> tuple[Entry, ...]:
    """The checks so far, the earliest first; none where there is no history yet.

    Raises `GtpinError` if a line is damaged, or the page is there and the file of lines is missing.
    """
    file = files.folder / files.lines
    if not file.exists():
        if (files.folder / files.page).exists():
            raise GtpinError(
                f"the history is lost: {files.page} is here, but not its lines",
                file=file,
                hint=f"restore it, or move {files.page} aside to begin anew",
            )
        return ()
    lines, entries = read_text(file, GtpinError, hint="restore it from a copy").splitlines(), []
    hint = "restore it from a copy, or move it aside to begin anew"
    for number, line in enumerate(lines, 1):
        try:
            entries.append(Entry.model_validate(json.loads(line)))
            entries[-1].time  # noqa: B018  (a date that is none is an error)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            key, what = ".".join(str(part) for part in first["loc"]), f"the history is damaged ({first['msg']})"
            raise GtpinError(what, file=file, row=number, column=key, hint=hint) from None
        except (ValueError, RecursionError) as error:
            what = f"the history is damaged ({str(error)[:80]})"
            raise GtpinError(what, file=file, row=number, hint=hint) from None
    return tuple(entries)
