"""Moving finished results into place, so that a crash at any moment loses neither the old nor the new ones.

A work folder contains ``new/`` while results are made. When they are complete, ``new/`` is renamed to ``ready/``; from then
on another run can finish an interrupted move. Replaced files are in ``old/`` until the end.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from pathlib import Path

from gtpin.output.ownership import MARKER, alone_in, aside, foreign, mark, part_of_others, recorded, refuse_foreign

NEW, READY, OLD = "new", "ready", "old"

Move = tuple[Path, Path]


def place(work: Path, folder: Path, names: Collection[str], force: bool, alone: bool = False) -> None:
    """Move the content of ``new/`` into a folder: all of it, or nothing where that fails.

    Files with ``names`` that gtpin wrote itself are replaced, or deleted where ``new/`` does not have them. Other files with
    these names are renamed with ``force``; with ``alone``, so are parts of other results.

    Raises
    ------
    GtpinError
        If, without ``force``, a file with one of ``names`` was not written by gtpin.
    OSError
        If the folder can't be written.
    """
    written = os.listdir(work / NEW)
    going = {*names, *written} - {MARKER}
    refuse_foreign(folder, [*sorted(going), MARKER], force, alone=alone)
    others = {name: digest for name, digest in recorded(folder).items() if name not in going}
    mark(work / NEW, others, (alone_in(folder) & set(others)) | (going if alone else set()))
    os.replace(work / NEW, work / READY)
    moves: list[Move] = []
    try:
        _move(work, folder, going - set(written), force, moves, alone)
    except BaseException:
        for start, end in reversed(moves):
            os.replace(end, start)
        os.replace(work / READY, work / NEW)
        raise
    _emptied(work)


def resume(work: Path, folder: Path) -> None:
    """Finish a move that a crash has interrupted. Files that have appeared since then are not replaced."""
    if (work / READY).is_dir():
        _move(work, folder, (), False, [])
        _emptied(work)


def _emptied(work: Path) -> None:
    """Delete ``ready/``, with results that could not be moved."""
    for entry in sorted((work / READY).iterdir()):
        os.replace(entry, work / OLD / f"{entry.name}.new")
    (work / READY).rmdir()


def _move(work: Path, folder: Path, gone: Iterable[str], force: bool, moves: list[Move], alone: bool = False) -> None:
    (work / OLD).mkdir(exist_ok=True)
    # The marker last: until then the old one lists the old results that may be replaced.
    for name in [*gone, *sorted(os.listdir(work / READY), key=lambda name: (name == MARKER, name))]:
        there, ready = folder / name, work / READY / name
        if os.path.lexists(there):
            own = foreign(there) is None and not (alone and part_of_others(there))
            if not own and not force:
                continue
            try:
                _rename(there, work / OLD / name if own else aside(there), moves)
            except PermissionError:
                if name != MARKER:
                    raise
                continue  # in a folder that users share, the marker of another one stays
        if os.path.lexists(ready):
            _rename(ready, there, moves)


def _rename(start: Path, end: Path, moves: list[Move]) -> None:
    os.replace(start, end)
    moves.append((start, end))
