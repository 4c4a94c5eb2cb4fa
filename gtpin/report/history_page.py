"""Adds a check to a history of checks, and makes the history's page again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from gtpin.diagnosis.result import HealthCheck
from gtpin.errors import GtpinError
from gtpin.health.history import Changed, Entry, HistoryFiles, read_history, written_history
from gtpin.output.results import results_folder
from gtpin.report.embedded import Plot
from gtpin.report.figure import Drawing
from gtpin.report.page import Table, render
from gtpin.report.palette import ACCENT, GOOD, LINE, MYSTERY, SOFT, WARN
from gtpin.report.words import counted, length, quantity

Add = Callable[[HealthCheck], None]
COLORS = {"none": GOOD, "explained": ACCENT, "ambiguous": WARN, "unknown": MYSTERY}
WORDS = {
    "none": "no change",
    "explained": "changed",
    "ambiguous": "changed, cause open",
    "unknown": "unknown change",
}


@contextmanager
def history(path: Path, *, force: bool = False) -> Iterator[Add]:
    """Context with a function that adds a check to the history at ``path``: ``FILE.html`` or a folder.

    The history is read before the block begins, and its files are replaced together when the block ends without an error. Files
    that gtpin has not written, or that were changed since, are not replaced; with ``force`` they are renamed.

    Raises
    ------
    GtpinError
        If the history is damaged, missing or of another robot.
    """
    files = HistoryFiles.named(path)
    entries = read_history(files)
    with results_folder(files.folder, files.names, force=force, key=files.lines) as folder:

        def add(check: HealthCheck) -> None:
            now = Entry.of(check, datetime.now(UTC))
            if entries and entries[-1].robot != now.robot:
                hint = f"give a history of {now.robot} of its own"
                raise GtpinError(
                    f"this is a history of {entries[-1].robot}", file=files.folder / files.lines, hint=hint
                )
            every = (*entries, now)
            (folder / files.lines).write_text(written_history(every), encoding="utf-8")
            (folder / files.page).write_text(history_page(every), encoding="utf-8")

        yield add


def history_page(entries: Sequence[Entry]) -> str:
    """A history of checks as one self-contained HTML file."""
    last = entries[-1]
    changed = sum(entry.verdict != "none" for entry in entries)
    return render(
        "history.html",
        title=f"{last.robot}: checks",
        plots={"errors": Plot("errors", "Position error of each check over time", partial(history_drawing, entries))},
        robot=last.robot,
        headline=f"{counted(len(entries), 'check')}, {changed} of them with a change. The last: {WORDS[last.verdict]}.",
        table=_table(entries),
    )


def history_drawing(entries: Sequence[Entry]) -> Drawing:
    """Position error of the earlier model at each check, µm, in the colour of the verdict, and the noise."""
    dates = [entry.date for entry in entries]
    noise: dict[str, Any] = {
        "type": "scatter",
        "mode": "lines",
        "x": dates,
        "y": [1e6 * entry.noise_floor for entry in entries],
        "name": "noise alone",
        "line": {"color": SOFT, "dash": "dot"},
    }
    ways: dict[str, Any] = {
        "type": "scatter",
        "mode": "lines",
        "x": dates,
        "y": [1e6 * entry.position_rms for entry in entries],
        "showlegend": False,
        "hoverinfo": "skip",
        "line": {"color": LINE, "width": 1},
    }
    traces = [ways, noise]
    for verdict, color in COLORS.items():
        some = [entry for entry in entries if entry.verdict == verdict]
        if some:
            traces.append(
                {
                    "type": "scatter",
                    "mode": "markers",
                    "x": [entry.date for entry in some],
                    "y": [1e6 * entry.position_rms for entry in some],
                    "text": [_changes(entry) or "no change" for entry in some],
                    "name": WORDS[verdict],
                    "marker": {"color": color, "size": 9},
                }
            )
    layout = {
        "yaxis": {"title": {"text": "position error, RMS (µm)"}, "rangemode": "tozero"},
        "xaxis": {"type": "date"},
    }
    return Drawing(traces, layout)


def _table(entries: Sequence[Entry]) -> Table:
    rows = [
        [
            entry.time.strftime("%Y-%m-%d %H:%M"),
            WORDS[entry.verdict],
            _changes(entry),
            length(entry.position_rms),
            length(entry.noise_floor),
            str(entry.poses),
            entry.dataset,
        ]
        for entry in reversed(entries)
    ]
    return Table(("date (UTC)", "verdict", "changes", "error, RMS", "noise", "poses", "dataset"), rows)


def _changes(entry: Entry) -> str:
    return "; ".join(map(_change, entry.changes))


def _change(change: Changed) -> str:
    name = change.parameter.replace("_", " ")
    return f"{change.effect} at {change.site}, {name} {quantity(change.value, change.unit)}"
