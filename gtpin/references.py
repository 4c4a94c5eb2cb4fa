"""How a text refers to a robot: by a name, or by the path of a file."""

from __future__ import annotations

import os

SUFFIXES = (".urdf", ".xml", ".mjcf")
"""Suffixes of files that describe robots: URDF, and MJCF (``.xml`` may hold either)."""


def is_path(robot: str) -> bool:
    """Whether a reference to a robot is a path: it has a separator or a suffix of such a file; else it is a name."""
    return "/" in robot or "\\" in robot or os.sep in robot or robot.lower().endswith(SUFFIXES)
