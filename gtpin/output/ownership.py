"""Records, by a marker in each folder, which files gtpin has written itself: only these may be replaced by new results."""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import Any

from gtpin.errors import GtpinError

MARKER = ".gtpin.json"
SCHEMA = "gtpin-output/1"
FORCE = "name another place, or let --force (in Python: force=True) move it aside"

Record = dict[str, str | None]
"""Entries that gtpin wrote into a folder: by name, the SHA-256 of a file; None for a folder, which has its own marker."""


def recorded(folder: Path) -> Record:
    """The entries of a folder's marker; empty where there is no marker, or it can't be read."""
    entries = _marker_content(folder).get("entries")
    return entries if isinstance(entries, dict) else {}


def alone_in(folder: Path) -> set[str]:
    """Names of the files that a folder's marker lists as single results, such as the table of ``gtpin predict``."""
    names = _marker_content(folder).get("alone")
    return {str(name) for name in names} if isinstance(names, list) else set()


def other_results(folder: Path, names: Collection[str]) -> set[str]:
    """Names of the files of results of other kinds in a folder of which a result with ``names`` would replace a part."""
    touched = [one for one in results_in(folder) if one & set(names)]
    there = [{name for name in one if os.path.lexists(folder / name)} for one in touched]
    return set().union(*(one for one in there if one - set(names)))


def part_of_others(path: Path) -> bool:
    """Whether gtpin wrote a file or folder as a part of a result, such as ``poses.csv`` of a dataset."""
    return os.path.lexists(path) and path.name in recorded(path.parent) and path.name not in alone_in(path.parent)


def results_in(folder: Path) -> list[set[str]]:
    """Of each result with a page in a folder, the names of its files; a dataset, which has none, is no result."""
    results = _marker_content(folder).get("results")
    return [{str(name) for name in one} for one in results] if isinstance(results, list) else []


def _marker_content(folder: Path) -> dict[str, Any]:
    file = folder / MARKER
    try:
        content = json.loads(file.read_text(encoding="utf-8")) if stat.S_ISREG(file.lstat().st_mode) else {}
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) and content.get("schema") == SCHEMA else {}


def mark(
    folder: Path, others: Record | None = None, alone: Collection[str] = (), results: Sequence[Collection[str]] = ()
) -> None:
    """Write the markers of a folder that gtpin has filled, and of all folders in it.

    ``others``: entries that will be added to the folder later. ``alone``: names of files that are single results.
    ``results``: of each result with a page, the names of its files.
    """
    entries: Record = {}
    for entry in sorted(folder.iterdir()):
        if entry.is_dir():
            mark(entry)
            entries[entry.name] = None
        elif entry.name != MARKER:
            entries[entry.name] = _digest(entry)
    entries = dict(sorted(((others or {}) | entries).items()))
    if entries:
        content: dict[str, Any] = {"schema": SCHEMA, "entries": entries}
        if alone:
            content["alone"] = sorted(alone)
        if results:
            content["results"] = [sorted(names) for names in results]
        text = json.dumps(content, indent=1) + "\n"
        (folder / MARKER).write_text(text, encoding="utf-8")


def foreign(path: Path) -> Path | None:
    """The first file or link at a path, or below it, that gtpin has not written or that was changed since.

    Links are never followed: gtpin writes none.
    """
    if not os.path.lexists(path):
        return None
    return next(_foreign(path, recorded(path.parent)), None)


def _foreign(path: Path, record: Record) -> Iterator[Path]:
    mode = path.lstat().st_mode
    if stat.S_ISDIR(mode):
        inside = recorded(path)
        for entry in sorted(path.iterdir()):
            yield from _foreign(entry, inside)
    elif not stat.S_ISREG(mode):
        yield path
    elif path.name == MARKER:
        if not record:
            yield path
    elif record.get(path.name) != _digest(path):
        yield path


def _digest(file: Path) -> str:
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def refuse_foreign(
    folder: Path, names: Iterable[str], force: bool, kind: type[GtpinError] = GtpinError, *, alone: bool = False
) -> None:
    """Raise an error where results would replace files that gtpin has not written.

    With ``alone`` (each file is a single result), also where one would replace a part of another result; else where it would
    replace a part of a result of another kind: what is left of that would be taken for its own. With ``force``, only for what
    is neither a file, a folder nor a link: a device can't be renamed.
    """
    names = list(names)
    if not alone and not force and (others := sorted(other_results(folder, names) - set(names))):
        raise kind(f"another result is here ({', '.join(others)})", file=folder, hint=FORCE)
    for name in names:
        found = foreign(folder / name)
        if found is None:
            if alone and not force and part_of_others(folder / name):
                raise kind("this is a part of what another command wrote here", file=folder / name, hint=FORCE)
            continue
        mode = (folder / name).lstat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or stat.S_ISLNK(mode)):
            raise kind("this is no file that can be replaced", file=found, hint="name a new file")
        if not force:
            raise kind("gtpin has not written this, or it was changed since", file=found, hint=FORCE)


def aside(path: Path) -> Path:
    """The first free name of ``NAME.old-1``, ``NAME.old-2``, ..."""
    names = (path.with_name(f"{path.name}.old-{number}") for number in count(1))
    return next(name for name in names if not os.path.lexists(name))


def was_moved_aside(name: str) -> bool:
    """Whether a name is one that :func:`aside` gives."""
    return re.search(r"\.old-[1-9][0-9]*$", name) is not None
