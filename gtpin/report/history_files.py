"""Adds a check to a history of checks, and makes the history's page again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from gtpin.errors import GtpinError
from gtpin.health.history import Entry, HistoryFiles, read_history, written_history
from gtpin.health.result import HealthCheck
from gtpin.output.results import results_folder
from gtpin.report.history_page import history_page

Add = Callable[[HealthCheck], None]


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
