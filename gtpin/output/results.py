"""Writing results into a folder: completely or not at all, and never over files that gtpin has not written itself."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from gtpin.errors import GtpinError
from gtpin.output.ownership import refuse_foreign
from gtpin.output.work_folder import NAME, NEW, place, placing_lock, work_folder

REASONS = (errno.EACCES, errno.EPERM, errno.EROFS)


@contextlib.contextmanager
def results_folder(
    target: Path,
    names: Collection[str],
    *,
    force: bool = False,
    kind: type[GtpinError] = GtpinError,
    key: str = "",
    shown: Path | None = None,
    alone: bool = False,
) -> Iterator[Path]:
    """Give a folder to write to, and move its content into ``target`` when the block has ended without an error.

    If the block fails, no files or new folders are left. The folder to write to is inside ``target``, so that only ``target``
    must be writable; ``target`` can be a mount point.

    ``target``: folder of the results; made where it is missing. Other files in it are not changed. ``names``: names of all
    files and folders that the results can have. Those that gtpin wrote itself are replaced. ``force``: rename files with
    these names that gtpin did not write, or that were changed since (``NAME.old-1``), and the whole of a result of another
    kind of which a part would be replaced. ``kind``: class of the error.
    ``key``: name of the part of the folder that is written: runs with other keys can write into it at the same time.
    ``shown``: path that errors name, where it is not the folder. ``alone``: whether each file is a single result; it then
    does not replace a part of another result, such as a dataset.

    Raises `GtpinError` if, before the block begins, a file that gtpin did not write, or a part of a result of another kind, has
    one of the names; another run is writing there; or the folder can't be written.
    """
    # A relative path may begin with ~, which some libraries expand to the home folder; an absolute path does not.
    given, target = target, target.absolute()
    if os.path.lexists(target) and not os.path.isdir(target):
        what = "a link that leads nowhere" if os.path.islink(target) and not os.path.exists(target) else "a file"
        raise kind(f"can't be written (there is {what} of this name)", file=given, hint="name a folder")
    missing = [folder for folder in (target, *target.parents) if not os.path.lexists(folder)]
    placed = False
    try:
        with writing(shown or given, kind):
            target.mkdir(parents=True, exist_ok=True)
            with work_folder(target, key) as work:
                refuse_foreign(target, names, force, kind, alone=alone)
                (work / NEW).mkdir()
                yield work / NEW
                with placing_lock(target):
                    place(work, target, names, force, alone)
        placed = True
    finally:
        if not placed:
            for folder in missing:
                with contextlib.suppress(OSError):
                    folder.rmdir()


@contextlib.contextmanager
def result_file(target: Path, *, force: bool = False, kind: type[GtpinError] = GtpinError) -> Iterator[Path]:
    """Give a file to write to, and move it to ``target`` when the block has ended without an error; see
    :func:`results_folder`."""
    check_file(target, force=force, kind=kind)
    name = target.name
    with results_folder(target.parent, [name], force=force, kind=kind, key=name, shown=target, alone=True) as folder:
        yield folder / target.name


def check_file(target: Path, *, force: bool = False, kind: type[GtpinError] = GtpinError) -> None:
    """Refuse a target that is a folder, or, without ``force``, a file that gtpin did not write or that is a part of another
    result."""
    if not target.name or os.path.isdir(target):
        raise kind("can't be written (this is a folder)", file=target, hint="name a file")
    if os.path.realpath(target.parent) == "/dev":
        raise kind("can't be written (this is a device)", file=target, hint="name a file; --json prints the result")
    with writing(target, kind):
        refuse_foreign(target.parent, [target.name], force, kind, alone=True)


@contextlib.contextmanager
def writing(target: Path, kind: type[GtpinError] = GtpinError) -> Iterator[None]:
    """Turn the system's errors on writing a file or folder into `GtpinError`."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        file, verb = target, "written"
        if error.filename is not None and not _is_of(target.absolute(), Path(os.fsdecode(error.filename))):
            file, verb = Path(os.fsdecode(error.filename)), "read"
        locked = read_only_folder(error) if verb == "written" else None
        hint = "check the path and its rights"
        if locked is not None:
            hint = f"the folder {_as_given(locked, target)} is read-only: change its rights, or name another place"
        raise kind(f"can't be {verb} ({reason})", file=file, hint=hint) from None


def _as_given(folder: Path, target: Path) -> Path:
    """A folder in, at or above a target, named relative to the working folder where the target is."""
    for given, whole in zip((target, *target.parents), (target.absolute(), *target.absolute().parents), strict=False):
        if folder.is_relative_to(whole):
            return given / folder.relative_to(whole)
    return folder


def _is_of(target: Path, file: Path) -> bool:
    """Whether a file is the target of writing, in it, or above it."""
    file = file.absolute()
    return NAME in str(file) or file == target or target in file.parents or file in target.parents


def read_only_folder(error: OSError) -> Path | None:
    """The folder that may not be written and so caused an error; None for another reason, or if it is not known.

    To move a folder, the folder itself must be writable; for all else, the folder that contains it.
    """
    if error.errno not in REASONS:
        return None
    for name in (error.filename, error.filename2):
        if name is None:
            continue
        path = Path(os.fsdecode(name)).absolute()
        there = [folder for folder in (path, *path.parents) if folder.is_dir() and not folder.is_symlink()]
        for folder in there[: 2 if there[:1] == [path] else 1]:
            if not os.access(folder, os.W_OK | os.X_OK):
                return folder
    return None


def json_text(content: object) -> str:
    """A result as JSON, from which exactly the same floats are read.

    Raises `GtpinError` if a number in it is not finite: no result is written then. The message names its key.
    """
    try:
        return json.dumps(content, indent=1, allow_nan=False) + "\n"
    except ValueError:
        where = next(_not_finite(content, ""), "a key")
        what = f"the result has no finite number for {where}, so nothing is written"
        raise GtpinError(
            what, hint="look for extreme numbers in the input, and say what they were in a bug report"
        ) from None


def fields(one: object, *names: str) -> dict[str, Any]:
    """Some attributes of an object by their names, as JSON has them."""
    return {name: getattr(one, name) for name in names}


def _not_finite(content: object, key: str) -> Iterator[str]:
    """Keys of numbers that are not finite, such as ``gap.interval.0``."""
    if isinstance(content, dict):
        for name, value in content.items():
            yield from _not_finite(value, f"{key}.{name}" if key else str(name))
    elif isinstance(content, list | tuple):
        for index, value in enumerate(content):
            yield from _not_finite(value, f"{key}.{index}")
    elif isinstance(content, float) and not math.isfinite(content):
        yield key
