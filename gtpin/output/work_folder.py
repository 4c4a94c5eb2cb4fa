"""The hidden folder in which results are made, inside the folder of the results. Only the process that holds its lock writes.

The system releases a lock when its process ends in any way. So a work folder whose lock is free was left by a killed run, and
can be cleared.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import shutil
import time
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

from gtpin.errors import GtpinError
from gtpin.output.ownership import (
    MARKER,
    alone_in,
    aside,
    foreign,
    mark,
    other_results,
    part_of_others,
    recorded,
    refuse_foreign,
    results_in,
)

NEW, READY, OLD = "new", "ready", "old"

Move = tuple[Path, Path]
NAME = ".gtpin-work"
OWN = re.compile(rf"{re.escape(NAME)}(-placing|-[0-9a-f]{{8}})?")
"""Names of all work folders in a folder."""
LOCK = "lock"
MOVING = 30.0
"""Seconds to wait while another run moves its results into the same folder, which takes it milliseconds."""
PATIENCE = 0.5
"""Seconds for which a lock is tried again: another run may hold it briefly, to check whether the folder is in use."""


def place(work: Path, folder: Path, names: Collection[str], force: bool, alone: bool = False) -> None:
    """Move the content of ``new/`` into a folder: all of it, or nothing where that fails.

    Files with ``names`` that gtpin wrote itself are replaced, or deleted where ``new/`` does not have them. Other files with
    these names are renamed with ``force``; with ``alone``, so are parts of other results, else whole results of other kinds.

    Raises `GtpinError` if, without ``force``, a file with one of ``names`` was not written by gtpin. `OSError` if the
    folder can't be written.
    """
    written = os.listdir(work / NEW)
    going = {*names, *written} - {MARKER}
    refuse_foreign(folder, [*sorted(going), MARKER], force, alone=alone)
    replaced = set() if alone else other_results(folder, going)  # with force
    others = {name: digest for name, digest in recorded(folder).items() if name not in going | replaced}
    kept = [one for one in results_in(folder) if alone or not one & going]
    page = not alone and any(name.endswith(".html") for name in going)
    results = [*kept, going] if page else kept
    mark(work / NEW, others, (alone_in(folder) & set(others)) | (going if alone else set()), results)
    os.replace(work / NEW, work / READY)
    moves: list[Move] = []
    try:
        _move(work, folder, (going | replaced) - set(written), force, moves, alone, replaced)
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


def _move(
    work: Path,
    folder: Path,
    gone: Iterable[str],
    force: bool,
    moves: list[Move],
    alone: bool = False,
    replaced: Collection[str] = (),
) -> None:
    (work / OLD).mkdir(exist_ok=True)
    # The marker last: until then the old one lists the old results that may be replaced.
    for name in [*gone, *sorted(os.listdir(work / READY), key=lambda name: (name == MARKER, name))]:
        there, ready = folder / name, work / READY / name
        if os.path.lexists(there):
            own = foreign(there) is None and not (alone and part_of_others(there)) and name not in replaced
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


def work_folder(folder: Path, key: str = "") -> contextlib.AbstractContextManager[Path]:
    """Give the work folder of a folder, or of the part ``key`` of it, and delete it at the end.

    Work folders that killed runs have left are cleared first; an interrupted move of results is finished.

    Raises `GtpinError` if another run holds it.
    """
    _clear(folder)
    work = folder / (f"{NAME}-{hashlib.sha256(os.fsencode(key)).hexdigest()[:8]}" if key else NAME)
    return _held(work, PATIENCE, "another run of gtpin is writing here", "wait for it, or name another place; ")


def placing_lock(folder: Path) -> contextlib.AbstractContextManager[Path]:
    """Wait until no other run moves results into a folder, because moving reads the folder's marker and writes it again."""
    return _held(folder / f"{NAME}-placing", MOVING, "another run is moving results here")


@contextlib.contextmanager
def _held(work: Path, patience: float, what: str, hint: str = "") -> Iterator[Path]:
    held = _hold(work, time.monotonic() + patience)
    if held is None:
        raise GtpinError(what, file=work.parent, hint=f"{hint}if there is none, remove {work.name}")
    try:
        yield work
    finally:
        _release(work, held)


def _clear(folder: Path) -> None:
    with os.scandir(folder) as entries:
        names = [entry.name for entry in entries if OWN.fullmatch(entry.name)]
    for work in (folder / name for name in sorted(names)):
        held = _hold(work, 0.0) if _is_own(work) else None
        if held is not None:
            try:
                if (work / READY).is_dir():
                    with placing_lock(folder):
                        resume(work, folder)
            finally:
                _release(work, held)


def _hold(work: Path, until: float) -> int | None:
    """Lock a work folder, which is made where it is missing; None where another process holds it until the time ``until``."""
    while True:
        made = True
        try:
            work.mkdir()
        except FileExistsError:
            if not _is_own(work):
                raise GtpinError("this is in the way", file=work, hint="move it aside") from None
            made = False
        try:
            held = os.open(work / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        except FileNotFoundError:
            continue  # the run that held it has deleted it meanwhile
        except PermissionError:
            busy = True  # it is another user's
        else:
            busy = False
            try:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                busy = True
            except OSError:  # a file system without locks: the run that has made the folder holds it
                busy = not made
            with contextlib.suppress(FileNotFoundError):  # the run that held it before may have deleted it
                if not busy and os.path.samestat(os.fstat(held), (work / LOCK).stat()):
                    return held
            os.close(held)
        if busy:
            if time.monotonic() >= until:
                return None
            time.sleep(0.01)


def _is_own(work: Path) -> bool:
    """Whether a folder with the name of a work folder is one: it has no other content than such a folder."""
    try:
        return not work.is_symlink() and {*os.listdir(work)} <= {LOCK, NEW, READY, OLD}
    except NotADirectoryError:
        return False
    except (FileNotFoundError, PermissionError):  # it is that of a run that has just ended, or another user's
        return True


def _release(work: Path, held: int) -> None:
    """Delete a work folder, except for results that were being moved and could not be moved back."""
    try:
        if not (work / READY).exists():
            for entry in work.iterdir():
                if entry.name != LOCK:
                    shutil.rmtree(entry, ignore_errors=True)
            with contextlib.suppress(OSError):
                (work / LOCK).unlink()
                work.rmdir()
    finally:
        os.close(held)
