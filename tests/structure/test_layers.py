"""The order of the package: a layer imports only those below it, no files import each other in a circle, no data is kept."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import gtpin
from gtpin.extensions import extension_names
from gtpin.output.shown import PRESENTATIONS

PACKAGE = Path(gtpin.__file__).parent
LAYERS = (
    ("errors", "typing", "distributions", "estimate", "read_only"),
    ("real",),
    ("memory", "threads", "references", "extensions", "spread"),
    ("output",),
    ("data",),
    ("robot",),
    ("kinematics",),
    ("effects", "noise", "paper"),
    ("model",),
    ("instruments",),
    ("calibration",),
    ("diagnosis", "accuracy", "comparison", "compensation"),
    ("planning",),
    ("report",),
    ("export",),
    ("commands",),
    ("extras",),
    ("bench",),
    ("cli",),
    ("__main__", "plant", "sim"),
)
"""Folders and single files of the package, the lowest first. ``robot`` reads ``data`` for the names of commands; ``bench``
makes machines and judges answers."""
NOT_CORE = ("extras", "bench", "plant", "sim")
"""Parts that the core reaches by entry points alone; ``plant`` is the former name of ``bench.simulator``, ``sim`` the public
name of a part of ``extras.simulators``."""
ASKING = {
    "calibration/checks/before_fit.py": 2,
    "calibration/checks/prior_conflict.py": 1,
    "data/dataset.py": 2,
    "diagnosis/against.py": 2,
    "diagnosis/earlier.py": 1,
    "diagnosis/joint_fit.py": 1,
    "diagnosis/gap.py": 1,
    "diagnosis/design.py": 3,
    "diagnosis/doubts.py": 1,
    "diagnosis/prepare.py": 1,
    "instruments/readings.py": 2,
    "report/residuals.py": 1,
}
"""Lines that still ask whether a lone tracker's poses or other readings were measured. The numbers may only fall."""
HEIGHT = {name: height for height, layer in enumerate(LAYERS) for name in layer}


def modules() -> dict[str, Path]:
    """All files of the package by their dotted names."""
    files = sorted(PACKAGE.rglob("*.py"))
    return {
        ".".join(("gtpin", *file.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): file
        for file in files
    }


MODULES = modules()


@cache
def nodes(file: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))


def imports_of(file: Path) -> Iterator[str]:
    """The package's modules that a file imports, at its top, in a function or for types."""
    for node in nodes(file):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield from [name for name in (whole, node.module or "") if name in MODULES][:1]


@cache
def imported() -> dict[str, tuple[str, ...]]:
    return {module: tuple(imports_of(file)) for module, file in MODULES.items()}


def place(module: str) -> str:
    """The folder or single file of the package that a module belongs to; empty for the package itself."""
    return (*module.split("."), "")[1]


def test_a_layer_imports_only_what_stands_below_it() -> None:
    wrong = [
        f"{module} imports {other}"
        for module, others in imported().items()
        for other in others
        if place(module) and place(other) and place(module) != place(other)
        if HEIGHT[place(other)] >= HEIGHT[place(module)]
    ]
    assert wrong == []


def test_the_core_imports_no_extras_and_no_bench() -> None:
    core = {module for module in MODULES if place(module) not in ("", *NOT_CORE)}
    wrong = [f"{module} imports {other}" for module in core for other in imported()[module] if place(other) in NOT_CORE]
    assert wrong == []
    assert {place(module) for module in MODULES} >= {"commands", *NOT_CORE}


ROOMS = (
    "result",
    "priors",
    "prepare",
    "design",
    "evidence",
    "scan",
    "hypothesis",
    "smooth_terms",
    "hypothesis_set",
    "periodic_lines",
    "search",
    "propose",
    "noise",
    "classes",
    "verdict",
    "joint_fit",
    "gap",
    "tolerances",
    "leaders",
    "doubts",
    "jumps",
    "trials",
    "discrimination",
    "next_experiment",
    "why",
    "earlier",
    "changed_geometry",
    "against",
    "diagnose",
)
"""Files of ``gtpin/diagnosis``: each may use those before it."""


def room(module: str) -> str:
    """The room of a module of ``gtpin/diagnosis``; empty for all other modules."""
    _, folder, name, *_ = (*module.split("."), "", "")
    return name if folder == "diagnosis" else ""


def test_no_room_of_a_diagnosis_uses_one_after_it() -> None:
    assert {room(module) for module in MODULES} - {""} == {*ROOMS}
    wrong = [
        f"{module} imports {other}"
        for module, others in imported().items()
        for other in others
        if room(module) and room(other) and ROOMS.index(room(other)) > ROOMS.index(room(module))
    ]
    assert wrong == []


def test_no_effect_is_named_by_a_string_with_its_site() -> None:
    """Hypotheses are values: ``effect@site`` is written for messages, and for the JSON of experiments."""
    files = [file for file in (PACKAGE / "diagnosis").rglob("*.py") if "@{" in file.read_text(encoding="utf-8")]
    assert {file.name for file in files} == {"hypothesis.py", "result.py"}


def test_the_verdict_is_decided_in_one_file() -> None:
    deciding = [
        file.name
        for file in (PACKAGE / "diagnosis").rglob("*.py")
        if re.search(r'return "unknown"', file.read_text("utf-8"))
    ]
    assert deciding == ["verdict.py"]


def test_the_simulator_imports_nothing_of_what_it_shall_judge() -> None:
    """Below the kinematics stand files, tables and the description of a robot; those import nothing higher."""
    others = {other for module, names in imported().items() if ".bench.simulator" in module for other in names}
    outside = {place(other) for other in others if not other.startswith("gtpin.bench.simulator")}
    assert "robot" in outside  # the search went outside
    assert all(HEIGHT[name] < HEIGHT["kinematics"] for name in outside), outside


def test_nothing_that_the_worker_of_a_blind_check_builds_on_knows_the_simulator_or_the_truth() -> None:
    reached, waiting = set(), ["gtpin.bench.blind.worker"]
    while waiting:
        module = waiting.pop()
        reached.add(module)
        waiting += {*imported()[module]} - reached
    assert "gtpin.diagnosis.diagnose" in reached
    assert {name for name in reached if name.startswith("gtpin.bench.")} == {"gtpin.bench.blind.worker"}


def test_no_files_import_each_other_in_a_circle() -> None:
    arrows = {module: {*others} - {module} for module, others in imported().items()}
    tuple(TopologicalSorter(arrows).static_order())  # raises CycleError


def test_few_ask_whether_poses_or_readings_were_measured() -> None:
    asks = re.compile(r"readings is (?:not )?None|\bas_tracker\b|\.tracked\b")
    found = {
        file.relative_to(PACKAGE).as_posix(): len(asks.findall(file.read_text(encoding="utf-8")))
        for file in MODULES.values()
    }
    assert {file: number for file, number in found.items() if number} == ASKING


def test_every_result_that_is_shown_has_a_presentation() -> None:
    for name, file in PRESENTATIONS.items():
        assert f"\nclass {name}Presentation" in MODULES[file].read_text(encoding="utf-8")
    kinds = {"Shown", "SavedResult", "FitResult"}
    shown = {
        node.name
        for module, file in MODULES.items()
        if module != "gtpin.output.shown"
        for node in nodes(file)
        if isinstance(node, ast.ClassDef) and any(getattr(base, "id", "") in kinds for base in node.bases)
    }
    assert shown <= {*PRESENTATIONS, *extension_names("gtpin.presentations")}
    assert "Diagnosis" in shown


def test_the_simulator_reads_and_imports_nothing_by_names_that_are_made_at_run_time() -> None:
    """The import graph that the other tests search is the whole of it, and no file outside is opened by its name."""
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    allowed = {re.split(r"[^\w-]", need)[0].replace("-", "_") for need in project["dependencies"]}
    allowed |= {"gtpin", "pinocchio", *sys.stdlib_module_names}  # pin is imported as pinocchio
    for module, file in MODULES.items():
        if ".bench.simulator" not in module:
            continue
        for node in nodes(file):
            if isinstance(node, ast.Import):
                assert {alias.name.partition(".")[0] for alias in node.names} <= allowed, module
            elif isinstance(node, ast.ImportFrom):
                assert str(node.module).partition(".")[0] in allowed, module
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert len(node.value) < 2 or not Path(node.value).is_absolute(), f"{module}, line {node.lineno}"
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in ("__import__", "import_module", "eval", "exec"), f"{module}, {node.lineno}"


@pytest.mark.slow
def test_a_machine_is_made_without_anything_in_memory_that_shall_be_judged_by_it() -> None:
    judged = tuple(
        f"gtpin.{name}" for name, height in HEIGHT.items() if HEIGHT["kinematics"] <= height < HEIGHT["bench"]
    )
    code = (
        "import sys; from gtpin.bench.simulator import make_case, simulate, simulate_measured;"
        "from gtpin.bench.simulator.build import known_robot;"
        "make_case(0, poses=20, held_out=5); simulate(known_robot('stewart'), 'stewart', poses=5, held_out=2);"
        "simulate_measured(known_robot('stewart'), 'stewart', ['range', 'plane', 'socket'], poses=5, held_out=2);"
        f"sys.exit(', '.join(name for name in sys.modules if name.startswith({judged!r})) or 0)"
    )
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr


SMALL = {"int", "bool", "str", "str | None", "frozenset[str]"}
"""Types of the arguments by which something may be kept as long as the process: they hold no data."""


def kept_for_the_process() -> list[tuple[str, list[str]]]:
    """Functions of the package with a cache of the process, and the types of their arguments."""
    found = []
    for file in MODULES.values():
        for node in nodes(file):
            if not isinstance(node, ast.FunctionDef):
                continue
            if any(ast.unparse(one).split("(")[0].endswith(("cache", "lru_cache")) for one in node.decorator_list):
                kinds = [ast.unparse(one.annotation) if one.annotation else "" for one in node.args.args]
                found.append((f"{file.relative_to(PACKAGE)}: {node.name}", kinds))
    return found


def test_what_is_kept_as_long_as_the_process_depends_on_no_data() -> None:
    found = kept_for_the_process()
    assert found
    assert [name for name, kinds in found if not {*kinds} <= SMALL] == []
