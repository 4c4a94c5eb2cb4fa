"""Where commands put their results: whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path

from gtpin.errors import GtpinError


@contextlib.contextmanager
def results_folder(target: Path) -> Iterator[Path]:
    """Give a folder beside ``target`` to write to, and move what is in it into place once the block has ended well.

    Where ``target`` is there already, what has the same names is replaced and everything else stays. Where the block
    fails, nothing is left, not even the folders above.

    Raises
    ------
    GtpinError
        If the folder can't be written.
    """
    target = target.absolute()
    if target.exists() and not target.is_dir():
        raise GtpinError("there is a file of this name", file=target, hint="name a folder")
    missing = [folder for folder in target.parents if not folder.exists()]
    beside = target.with_name(f".{uuid.uuid4().hex}")
    placed = False
    try:
        with writing(target):
            beside.mkdir(parents=True)
            yield beside
            _place(beside, target)
        placed = True
    finally:
        shutil.rmtree(beside, ignore_errors=True)
        if not placed:
            for folder in missing:
                with contextlib.suppress(OSError):
                    folder.rmdir()


def _place(beside: Path, target: Path) -> None:
    if not target.exists():
        os.replace(beside, target)
        return
    for entry in sorted(beside.iterdir()):
        place = target / entry.name
        old = target / f".{uuid.uuid4().hex}"
        if place.exists():
            os.replace(place, old)
        os.replace(entry, place)
        if old.is_dir():
            shutil.rmtree(old, ignore_errors=True)
        else:
            old.unlink(missing_ok=True)


@contextlib.contextmanager
def writing(target: Path, kind: type[GtpinError] = GtpinError) -> Iterator[None]:
    """Turn what the system says against writing a file or folder into an error of the family."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise kind(f"can't be written ({reason})", file=target, hint="check the path and its rights") from None
