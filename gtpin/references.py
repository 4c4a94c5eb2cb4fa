"""How a text refers to a robot: by a name, or by the path of a file."""

from __future__ import annotations

import os
from pathlib import Path

SUFFIXES = (".urdf", ".xml", ".mjcf")
"""Suffixes of files that describe robots: URDF, and MJCF (``.xml`` may hold either)."""


def is_path(robot: str) -> bool:
    """Whether a reference to a robot is a path: it has a separator or a suffix of such a file; else it is a name."""
    return "/" in robot or "\\" in robot or os.sep in robot or robot.lower().endswith(SUFFIXES)


def seen_from(robot: str, folder: Path) -> str:
    """How a dataset in a folder names a robot: a path starts at the folder."""
    if is_path(robot):
        return Path(os.path.relpath(robot, folder)).as_posix()
    return robot
