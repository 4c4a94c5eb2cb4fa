"""Adds a check to a history of checks, and makes the history's page again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from gtpin.data import Dataset
from gtpin.diagnosis.result import HealthCheck
from gtpin.errors import GtpinError
from gtpin.extras.history.history import Entry, HistoryFiles, read_history, refuse_readings
from gtpin.output.results import results_folder
from gtpin.report.figure import ACCENT, GOOD, LINE, MYSTERY, SOFT, WARN, Drawing, Plot, scatter
from gtpin.report.page import Lead, Plots, Section, Table, report
from gtpin.report.phrases import known_as, parameter
from gtpin.report.words import counted, length

COLORS = {"none": GOOD, "explained": ACCENT, "ambiguous": WARN, "unknown": MYSTERY}
WORDS = {"none": "no change", "explained": "changed", "ambiguous": "changed, cause open", "unknown": "unknown change"}


@dataclass(frozen=True)
class History:
    """A history of checks that is open.

    ``files``: its files. ``entries``: the checks so far, the earliest first. ``folder``: where the new files are written.
    """

    files: HistoryFiles
    entries: tuple[Entry, ...]
    folder: Path

    @property
    def page(self) -> Path:
        """The page of all checks."""
        return self.files.folder / self.files.page

    def refuse_readings(self, dataset: Dataset) -> None:
        """Raise `DatasetError` if the dataset is not of one tracker's poses."""
        refuse_readings(dataset)

    def add(self, check: HealthCheck) -> None:
        """Write the files with this check; raises `GtpinError` if the history is of another robot."""
        now = Entry.of(check, datetime.now(UTC))
        if self.entries and self.entries[-1].robot != now.robot:
            what, hint = f"this is a history of {self.entries[-1].robot}", f"give a history of {now.robot} of its own"
            raise GtpinError(what, file=self.files.folder / self.files.lines, hint=hint)
        every = (*self.entries, now)
        lines = "".join(entry.model_dump_json(by_alias=True) + "\n" for entry in every)
        (self.folder / self.files.lines).write_text(lines, encoding="utf-8")
        (self.folder / self.files.page).write_text(history_page(every), encoding="utf-8")


@contextmanager
def history(path: Path, *, force: bool = False) -> Iterator[History]:
    """Context with the history at ``path``: ``FILE.html`` or a folder; checks are added to it.

    The history is read before the block begins, and its files are replaced together when the block ends without an error. Files
    that gtpin has not written, or that were changed since, are not replaced; with ``force`` they are renamed.

    Raises `GtpinError` if the history is damaged, missing or of another robot.
    """
    files = HistoryFiles.named(path)
    entries = read_history(files)
    with results_folder(files.folder, files.names, force=force, key=files.lines) as folder:
        yield History(files, entries, folder)


def history_page(entries: Sequence[Entry]) -> str:
    """A history of checks as one self-contained HTML file."""
    last = entries[-1]
    changed = sum(entry.verdict != "none" for entry in entries)
    rows = []
    for entry in reversed(entries):
        said = [entry.time.strftime("%Y-%m-%d %H:%M"), WORDS[entry.verdict], _changes(entry)]
        sizes = [length(entry.position_rms), length(entry.noise_floor), str(entry.poses)]
        rows.append([*said, *sizes, entry.dataset])
    head = ("date (UTC)", "verdict", "changes", "error, RMS", "noise alone", "poses", "dataset")
    plot = Plot("errors", "Position error of each check over time", partial(history_drawing, entries))
    found = f"{counted(len(entries), 'check')}, {changed} of them with a change. The last: {WORDS[last.verdict]}."
    sections = [
        Section("errors", "Position error, each pose predicted by the earlier model and all others", [Plots([plot])]),
        Section("checks", "Checks, the last first", [Table(head, rows, (3, 4, 5))]),
    ]
    lead = Lead(f"Checks over time · {last.robot}", found, tab=f"{last.robot}: checks")
    return report(lead, sections)


def history_drawing(entries: Sequence[Entry]) -> Drawing:
    """Position error at each check, µm, in the colour of the verdict, and the noise.

    Each pose is predicted by the earlier model and all others.
    """

    def trace(some: Sequence[Entry], mode: str, key: str = "position_rms", **look: Any) -> dict[str, Any]:
        return scatter(mode, [entry.date for entry in some], [1e6 * getattr(entry, key) for entry in some], **look)

    traces = [
        trace(entries, "lines", showlegend=False, hoverinfo="skip", line={"color": LINE, "width": 1}),
        trace(entries, "lines", "noise_floor", name="noise alone", line={"color": SOFT, "dash": "dot"}),
    ]
    for verdict, color in COLORS.items():
        some = [entry for entry in entries if entry.verdict == verdict]
        if some:
            texts = [_changes(entry) or "no change" for entry in some]
            look: dict[str, Any] = {"text": texts, "name": WORDS[verdict], "marker": {"color": color, "size": 9}}
            traces.append(trace(some, "markers", **look))
    yaxis = {"title": {"text": "position error, RMS (µm)"}, "rangemode": "tozero"}
    return Drawing(traces, {"yaxis": yaxis, "xaxis": {"type": "date"}})


def _changes(entry: Entry) -> str:
    return "; ".join(
        f"{known_as(one.effect, one.site)}, {' '.join(parameter(one.parameter, one.value, one.unit))}"
        for one in entry.changes
    )
