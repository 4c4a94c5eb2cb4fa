"""The rooms of ``gtpin/diagnosis``: few, imported in one direction, and keyed by values."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import gtpin

HOUSE = Path(gtpin.__file__).parent / "diagnosis"
ORDER = ("priors", "prepare", "linear", "hypotheses", "inference", "planning", "result", "against", "diagnose")
"""Each room may use those before it."""


def rooms() -> dict[str, list[Path]]:
    """Files by room: a folder, or a file of the top floor."""
    found: dict[str, list[Path]] = {}
    for file in HOUSE.rglob("*.py"):
        room = file.relative_to(HOUSE).parts[0].removesuffix(".py")
        if room != "__init__":
            found.setdefault(room, []).append(file)
    return found


def modules_of(file: Path) -> list[str]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]


def used_by(files: list[Path]) -> set[str]:
    names = [name.split(".") for file in files for name in modules_of(file)]
    return {parts[2] for parts in names if parts[:2] == ["gtpin", "diagnosis"] and len(parts) > 2}


def test_there_are_at_most_nine_rooms():
    assert set(rooms()) == set(ORDER)
    assert len(ORDER) <= 9


def test_no_room_uses_one_after_it():
    arrows = {room: used_by(files) - {room} for room, files in rooms().items()}
    tuple(TopologicalSorter(arrows).static_order())  # raises CycleError where arrows go round
    for room, used in arrows.items():
        assert {ORDER.index(other) < ORDER.index(room) for other in used} <= {True}, room


def test_no_effect_is_named_by_a_string_with_its_site():
    """Hypotheses are values: ``effect@site`` is written for messages, and for the JSON of experiments."""
    files = [file for file in HOUSE.rglob("*.py") if "@{" in file.read_text(encoding="utf-8")]
    assert {file.name for file in files} == {"hypothesis.py", "experiment.py"}


def test_the_verdict_is_decided_in_one_file():
    deciding = [
        file.name
        for file in HOUSE.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Return) and isinstance(node.value, ast.Constant) and node.value.value == "unknown"
    ]
    assert deciding == ["findings.py"]
