"""A chain is asked for poses, derivatives and loads, and nobody asks of what kind it is."""

from __future__ import annotations

import re
from pathlib import Path

import gtpin

PACKAGE = Path(gtpin.__file__).parent
OWN = ("robot", "kinematics", "bench")
"""Folders that make chains, and the simulator, which has its own."""


def asking(pattern: str) -> set[str]:
    found = (file for file in PACKAGE.rglob("*.py") if file.relative_to(PACKAGE).parts[0] not in OWN)
    return {
        file.relative_to(PACKAGE).as_posix() for file in found if re.search(pattern, file.read_text(encoding="utf-8"))
    }


def test_nobody_asks_kinematics_for_its_class() -> None:
    assert asking(r"isinstance\([^)]*Kinematics\)") == set()


def test_nobody_takes_a_robot_s_rods() -> None:
    assert asking(r"\.rods\b") == set()


def test_no_two_classes_have_one_name() -> None:
    found = [
        name for file in PACKAGE.rglob("*.py") for name in re.findall(r"^ *class (\w+)", file.read_text("utf-8"), re.M)
    ]
    assert len(found) > 300
    assert sorted({name for name in found if found.count(name) > 1}) == []
