"""Reserves a folder for one check, which can be resumed, and locks it for one run at a time."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from gtpin.bench.blind.folder import CheckFolder, Settings
from gtpin.data.files import UNFINISHED, placed_file
from gtpin.errors import GtpinError
from gtpin.output.ownership import MARKER, aside, refuse_foreign
from gtpin.output.results import writing
from gtpin.output.work_folder import work_folder

SCHEMA = "gtpin-blind/1"
CLAIM = "check.json"
"""The check's settings."""
SCORE_FILES = ("judged.json", "score.json", "score.html")
"""Files that are written after all cases are judged."""


@contextlib.contextmanager
def claimed(folder: CheckFolder, settings: Settings, force: bool = False) -> Iterator[None]:
    """Make a folder, or resume the same check in it; the folder is locked for other runs.

    A new check that ends before a case is complete leaves no files. With ``force``, files of another check, or files that
    gtpin did not write, are renamed (``NAME.old-1``).

    Raises GtpinError if the folder contains other files, another run uses it, or it can't be written.
    """
    root = folder.root
    if os.path.lexists(root) and not os.path.isdir(root):
        raise GtpinError("this is not the folder of a check", file=root, hint="name a new folder")
    missing = [place for place in (root, *root.parents) if not os.path.lexists(place)]
    try:
        with contextlib.ExitStack() as held:
            with writing(root):
                root.mkdir(parents=True, exist_ok=True)
                held.enter_context(work_folder(root, "check"))
                _claim(folder, settings, force)
            try:
                yield
            finally:
                if _unbegun(folder):
                    _give_up(folder)
    finally:
        for place in missing:
            with contextlib.suppress(OSError):  # not empty: it holds the check
                place.rmdir()


def _claim(folder: CheckFolder, settings: Settings, force: bool) -> None:
    content = {"schema": SCHEMA, **asdict(settings)}
    there = _there(folder)
    other = next((name for name, value in content.items() if there.get(name) != value), None)
    if there and other and _unbegun(folder):
        _give_up(folder)
    elif other:
        _make_room(folder, _others(folder.root, other) if there else _foreign_files(folder), force)
    refuse_foreign(folder.root, SCORE_FILES, force)
    for part in folder.parts:
        part.mkdir(exist_ok=True)
        for unfinished in part.glob(f"{UNFINISHED}*"):  # of a run that was killed
            unfinished.unlink()
    if not _there(folder):
        try:
            with placed_file(folder.root / CLAIM) as new:
                new.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        except GtpinError:
            _give_up(folder)
            raise


def _there(folder: CheckFolder) -> dict[str, object]:
    """The settings of the folder's check; empty if there is none."""
    try:
        there = json.loads((folder.root / CLAIM).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return there if isinstance(there, dict) and there.get("schema") == SCHEMA else {}


def _unbegun(folder: CheckFolder) -> bool:
    """Whether the check can be deleted without loss: no case was made, or the given cases were not yet all copied."""
    begun = any((folder.root / "sealed").glob("*.json"))
    return not folder.published and (not begun or _there(folder).get("source") is not None)


def _give_up(folder: CheckFolder) -> None:
    for part in folder.parts:
        shutil.rmtree(part, ignore_errors=True)
    with contextlib.suppress(OSError):
        (folder.root / CLAIM).unlink()


def _others(root: Path, other: str) -> GtpinError:
    words = {"diagnosis": "sources of the diagnosis", "plant": "sources of the plant", "source": "cases"}
    what = f"the folder belongs to another check: other {words.get(other, other)}"
    return GtpinError(what, file=root, hint="name a new folder, ask for the same again, or move it aside with --force")


def _foreign_files(folder: CheckFolder) -> GtpinError | None:
    """The error if a folder can't be used for a check; None if it is empty except for remains of a crash."""
    for entry in folder.root.iterdir():
        if entry.name.startswith((UNFINISHED, MARKER)):
            continue
        crash = not any(entry.iterdir()) if entry in folder.parts and entry.is_dir() else _is_empty_claim(entry)
        if not crash:
            hint = "name a new folder, or move what is in the way aside with --force"
            return GtpinError("this is not the folder of a check", file=folder.root, hint=hint)
    return None


def _is_empty_claim(entry: Path) -> bool:
    return entry.name == CLAIM and entry.is_file() and not entry.is_symlink() and entry.stat().st_size == 0


def _make_room(folder: CheckFolder, problem: GtpinError | None, force: bool) -> None:
    """Rename foreign files with ``force``, else raise the error; delete an empty check."""
    if problem is None:
        _give_up(folder)
        return
    if not force:
        raise problem
    for place in (*(folder.root / name for name in (CLAIM, "seconds.txt", *SCORE_FILES)), *folder.parts):
        if os.path.lexists(place):
            os.replace(place, aside(place))
