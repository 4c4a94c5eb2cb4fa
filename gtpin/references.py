"""How a text refers to a robot: by a name, or by the path of a file."""

from __future__ import annotations

import os
from pathlib import Path

SUFFIXES = (".urdf", ".xml", ".mjcf", ".yaml")
"""Suffixes of files that describe robots: URDF, MJCF (``.xml`` may hold either), and the loops of a URDF beside it."""


def is_path(robot: str) -> bool:
    """Whether a reference to a robot is a path: it has a separator or one of `SUFFIXES`. Otherwise it is a name."""
    return "/" in robot or "\\" in robot or os.sep in robot or robot.lower().endswith(SUFFIXES)


def seen_from(robot: str, folder: Path) -> str:
    """The reference to a robot in a dataset of ``folder``: a path is made relative to the folder, a name stays."""
    if is_path(robot):
        return Path(os.path.relpath(robot, folder)).as_posix()
    return robot
