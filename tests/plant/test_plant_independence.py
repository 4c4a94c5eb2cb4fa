"""A check whose truth comes from the code under test checks nothing."""

import ast
import importlib.util
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "gtpin"
JUDGED = (
    "gtpin.kinematics",
    "gtpin.effects",
    "gtpin.model",
    "gtpin.calibration",
    "gtpin.diagnosis",
    "gtpin.noise",
    "gtpin.instruments",
    "gtpin.comparison",
    "gtpin.compensation",
    "gtpin.report",
)


def source(module: str) -> str:
    found = importlib.util.find_spec(module)
    assert found is not None
    assert found.origin is not None
    return Path(found.origin).read_text(encoding="utf-8")


def imports(module: str) -> set[str]:
    """The modules of gtpin that a module names in its imports, wherever they stand."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source(module))):
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


@pytest.mark.slow
def test_no_module_of_the_plant_imports_what_it_shall_judge() -> None:
    for module in modules():
        assert not [name for name in imports(module) if name.startswith(JUDGED)], module
        assert "gtpin" not in imports(module), f"{module} imports the whole package"


@pytest.mark.slow
def test_nothing_that_the_plant_builds_on_imports_it_either() -> None:
    reached, waiting = set(), modules()
    while waiting:
        module = waiting.pop()
        if module not in reached:
            reached.add(module)
            waiting += imports(module) - reached
    assert not [name for name in reached if name.startswith(JUDGED)]
    assert {"gtpin.robot.robot", "gtpin.data.dataset"} < reached  # the search went outside


@pytest.mark.slow
def test_a_machine_is_made_without_anything_of_it_in_memory() -> None:
    code = (
        "import sys; from gtpin.plant import make_case, simulate, simulate_measured; from gtpin import load_robot;"
        "make_case(0, poses=20, held_out=5); simulate(load_robot('stewart'), 'stewart', poses=5, held_out=2);"
        "simulate_measured(load_robot('stewart'), 'stewart', ['range', 'plane', 'socket'], poses=5, held_out=2);"
        f"sys.exit(', '.join(name for name in sys.modules if name.startswith({JUDGED!r})) or 0)"
    )
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr


def test_nothing_that_is_judged_knows_the_plant() -> None:
    for part in JUDGED:
        assert (PACKAGE.parent / part.replace(".", "/")).is_dir()
        for file in (PACKAGE.parent / part.replace(".", "/")).rglob("*.py"):
            assert "gtpin.plant" not in file.read_text(), file


def test_the_plant_reads_no_file_outside_the_repository_and_imports_nothing_but_what_gtpin_depends_on() -> None:
    project = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {re.split(r"[^\w-]", need)[0].replace("-", "_") for need in project["dependencies"]}
    allowed = {"gtpin", "pinocchio"} | declared | sys.stdlib_module_names  # pin is imported as pinocchio
    for module in modules():
        tree = ast.parse(source(module))
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                assert {alias.name.partition(".")[0] for alias in node.names} <= allowed, module
            elif isinstance(node, ast.ImportFrom):
                assert str(node.module).partition(".")[0] in allowed, module
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert len(node.value) < 2 or not Path(node.value).is_absolute(), f"{module}, line {node.lineno}"
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in ("__import__", "import_module", "eval", "exec"), (
                    f"{module}, line {node.lineno}"
                )
