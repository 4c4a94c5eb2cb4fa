"""What computes results imports nothing of the report when it is loaded; results ask for it when they are shown."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "gtpin"
ROOMS = (
    "robot",
    "kinematics",
    "data",
    "effects",
    "calibration",
    "diagnosis",
    "accuracy",
    "model",
    "output",
    "plant",
    "certificate",
)
DOORS = (
    "gtpin.report.show",
    "gtpin.report.files",
    "gtpin.report.workspace_maps",
    "gtpin.report.measurements",
    "gtpin.report.diagnosis_json",
    "gtpin.report.unseen_words",
    "gtpin.report.certificate_json",
    "gtpin.report.certificate_files",
)
"""What methods of results may import when they are called."""


def imported(file: Path) -> Iterator[tuple[str, bool]]:
    """Modules of the report that a file imports, and whether it does so when it is loaded."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    later = {
        node for function in ast.walk(tree) if isinstance(function, ast.FunctionDef) for node in ast.walk(function)
    }
    for node in ast.walk(tree):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        yield from ((name, node not in later) for name in names if name.startswith("gtpin.report"))


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_that_computes_loads_no_report(room: str) -> None:
    files = sorted((PACKAGE / room).rglob("*.py"))
    assert files
    found = [(str(file.relative_to(PACKAGE)), name, at_load) for file in files for name, at_load in imported(file)]
    assert [entry for entry in found if entry[2]] == []
    assert [entry for entry in found if not entry[1].startswith(DOORS)] == []


def test_results_open_the_report_somewhere() -> None:
    assert {name for name, _ in imported(PACKAGE / "diagnosis" / "result.py")} >= {"gtpin.report.show.diagnosis"}
