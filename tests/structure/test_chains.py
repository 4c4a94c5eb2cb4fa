"""A chain is asked for poses, derivatives and loads, and nobody asks of what kind it is."""

from __future__ import annotations

import re
from pathlib import Path

import gtpin

PACKAGE = Path(gtpin.__file__).parent
OWN = ("robot", "kinematics", "bench")
"""Folders that make chains, and the simulator, which has its own."""
NAMING = ("placed", "dynamics", "motion", "frames")
"""Files of the kinematics that name rods: where a parameter, a force or a frame is a rod's."""
ROBOT_S_RODS = r"\brobot\.rods\b"


def asking(pattern: str, but: tuple[str, ...] = OWN) -> set[str]:
    """Lines, with their files, that match a pattern, but those of some folders."""
    files = (file for file in PACKAGE.rglob("*.py") if file.relative_to(PACKAGE).parts[0] not in but)
    return {
        f"{file.relative_to(PACKAGE).as_posix()}:{number}"
        for file in files
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(pattern, line)
    }


def test_nobody_asks_kinematics_for_its_class() -> None:
    assert asking(r"isinstance\([^)]*Kinematics\)") == set()


def test_nobody_takes_a_robot_s_rods_but_reports_and_the_paper_s_models() -> None:
    assert asking(ROBOT_S_RODS, (*OWN, "report", "paper")) == set()


def test_kinematics_take_rods_only_to_name_what_is_theirs() -> None:
    found = {place.partition(":")[0] for place in asking(ROBOT_S_RODS, ()) if place.startswith("kinematics/")}
    assert found <= {f"kinematics/{name}.py" for name in NAMING}


def test_there_are_no_kinematics_of_one_kind_of_robot() -> None:
    assert asking(r"RodKinematics|ChainKinematics|RodGeometry|\bof_rods\b", ("bench",)) == set()


def test_no_two_classes_have_one_name() -> None:
    found = [
        name for file in PACKAGE.rglob("*.py") for name in re.findall(r"^ *class (\w+)", file.read_text("utf-8"), re.M)
    ]
    assert len(found) > 300
    assert sorted({name for name in found if found.count(name) > 1}) == []
