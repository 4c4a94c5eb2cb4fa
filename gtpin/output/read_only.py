"""The folder that prevents a file from being written."""

from __future__ import annotations

import errno
import os
from pathlib import Path

REASONS = (errno.EACCES, errno.EPERM, errno.EROFS)


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
