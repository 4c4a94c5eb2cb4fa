"""A check whose truth comes from the code under test checks nothing."""

import ast
import importlib.util
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "gtpin"
JUDGED = ("gtpin.effects", "gtpin.diagnosis", "gtpin.calibration")
OLD = "gtpin.plant.simulate"
"""Knows no effects: it predicts with the package's own model, which may know some."""


def imports(module: str) -> set[str]:
    """The modules of gtpin that a module names in its imports, wherever they stand."""
    found = importlib.util.find_spec(module)
    assert found is not None
    assert found.origin is not None
    names: set[str] = set()
    for node in ast.walk(ast.parse(Path(found.origin).read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            names |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in names if name.startswith("gtpin") and _is_module(name)}


def _is_module(name: str) -> bool:
    path = PACKAGE.parent / Path(*name.split("."))
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def modules() -> list[str]:
    files = sorted((PACKAGE / "plant").rglob("*.py"))
    names = [".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts) for file in files]
    return [name.removesuffix(".__init__") for name in names]


def test_no_module_of_the_plant_imports_what_it_shall_judge() -> None:
    for module in modules():
        assert not [name for name in imports(module) if name.startswith(JUDGED)], module
        assert "gtpin" not in imports(module), f"{module} imports the whole package"


def test_nothing_that_the_plant_builds_on_imports_it_either() -> None:
    reached, waiting = set(), [module for module in modules() if module not in (OLD, "gtpin.plant")]
    while waiting:
        module = waiting.pop()
        if module not in reached:
            reached.add(module)
            waiting += imports(module) - reached
    assert not [name for name in reached if name.startswith(JUDGED)]


def test_nothing_that_is_judged_knows_the_plant() -> None:
    for part in ("effects", "diagnosis", "calibration"):
        for file in (PACKAGE / part).rglob("*.py"):
            assert "gtpin.plant" not in file.read_text(), file


def test_the_plant_needs_nothing_from_outside_the_repository() -> None:
    for module in modules():
        source = importlib.util.find_spec(module)
        assert source is not None
        assert "/work" not in Path(str(source.origin)).read_text()
