"""The process that diagnoses: what it knows, and what becomes of one that dies."""

import ast
import importlib.util
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from handmade import Quiet
from probes import dying, known_modules, plant_imported

import gtpin.bench.blind.run
from gtpin.bench.blind.folder import CheckFolder
from gtpin.bench.blind.spread import spread, workers
from gtpin.bench.blind.worker import diagnose_alone

PACKAGE = Path(__file__).parents[3] / "gtpin"


def _imports(module: str) -> set[str]:
    found = importlib.util.find_spec(module)
    assert found is not None
    assert found.origin is not None
    names: set[str] = set()
    for node in ast.walk(ast.parse(Path(found.origin).read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in names if name.startswith("gtpin") and _is_module(name)}


def _is_module(name: str) -> bool:
    path = PACKAGE.parent / Path(*name.split("."))
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


@pytest.mark.slow
def test_nothing_that_the_worker_builds_on_knows_the_plant_or_the_truth() -> None:
    reached, waiting = set(), ["gtpin.bench.blind.worker"]
    while waiting:
        module = waiting.pop()
        if module not in reached:
            reached.add(module)
            waiting += _imports(module) - reached
    assert "gtpin.diagnosis.diagnose" in reached
    assert not [name for name in reached if name.startswith("gtpin.bench.simulator")]
    assert {name for name in reached if name.startswith("gtpin.bench.blind")} == {"gtpin.bench.blind.worker"}


@pytest.mark.slow
def test_the_worker_does_not_import_the_plant() -> None:
    code = "import sys, gtpin.bench.blind.worker; print([m for m in sys.modules if m.startswith('gtpin.bench.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['gtpin.bench.blind', 'gtpin.bench.blind.worker']"


def test_a_process_that_knows_the_plant_refuses_to_diagnose(cases: Path) -> None:
    files = {file.name: file.read_bytes() for file in (cases / "a").iterdir()}
    said, _ = diagnose_alone(files)  # this process has made the dataset
    assert said.diagnosis is None
    assert "knows the plant" in str(said.error)


@pytest.mark.slow
def test_processes_that_made_cases_never_diagnose_any(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0}, raising=False)
    makers: list[int] = []
    found: list[tuple[int, list[str]]] = []
    with workers():
        assert not spread(plant_imported, ["a", "b"], lambda _: (), lambda _, told: makers.append(told[0]))
    with workers():
        assert not spread(known_modules, ["a", "b"], lambda _: (), lambda _, told: found.append(told))
    assert os.getpid() not in {*makers, *(process for process, _ in found)}
    assert not set(makers) & {process for process, _ in found}
    assert not [name for _, known in found for name in known if name.startswith("gtpin.bench.simulator")]


def test_a_worker_is_given_the_datasets_files_alone(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given_to = []
    monkeypatch.setattr(
        gtpin.bench.blind.run, "spread", lambda work, names, arguments, done: given_to.append(arguments("a")) or []
    )
    (tmp_path / "cases" / "a").mkdir(parents=True)
    for file in (cases / "a").iterdir():
        (tmp_path / "cases" / "a" / file.name).write_bytes(file.read_bytes())
    gtpin.bench.blind.run._diagnose(CheckFolder(tmp_path), {"a": ("backlash",)}, Quiet(), None, "x")
    ((files, exclude),) = given_to
    assert {name: type(content) for name, content in files.items()} == dict.fromkeys(
        ["canned.json", "commands.csv", "dataset.toml", "poses.csv"], bytes
    )
    assert exclude == ("backlash",)


@pytest.mark.slow
def test_a_process_that_dies_costs_its_own_case_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gtpin.bench.blind.spread.processes", lambda: 2)
    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", dying)
    folder, watch = CheckFolder(tmp_path), Quiet()
    (tmp_path / "diagnoses").mkdir()
    for name in ("a", "b", "c"):
        folder.case(name).mkdir(parents=True)
        (folder.case(name) / ("fatal" if name == "b" else "harmless")).touch()
    gtpin.bench.blind.run._diagnose(folder, dict.fromkeys("abc", ()), watch, None, "x")
    said = {name: folder.outcome(name) for name in "abc"}
    assert {name: told and told.error for name, told in said.items()} == {
        "a": "alive",
        "b": "the process that diagnosed it died",
        "c": "alive",
    }
    assert watch.done == 3


KILLED = """
import os, sys, time
from gtpin.bench.blind.spread import spread, workers
from probes import waiting

with workers():
    spread(waiting, ["a", "b"], lambda name: (sys.argv[1], name), lambda *_: None)
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes can't be listed")
def test_processes_end_when_the_one_that_started_them_is_killed(tmp_path: Path) -> None:
    paths = os.pathsep.join((str(PACKAGE.parent), str(Path(__file__).parent)))
    environment = {**os.environ, "PYTHONPATH": paths}
    parent = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path)], env=environment)
    for _ in range(1200):
        if len(list(tmp_path.glob("?"))) == 2 or parent.poll() is not None:
            break
        time.sleep(0.1)
    parent.kill()
    parent.wait()
    started = [int(file.read_text()) for file in tmp_path.glob("?")]
    assert len(started) == 2
    for _ in range(300):
        if not any(_runs(process) for process in started):
            break
        time.sleep(0.1)
    assert not any(_runs(process) for process in started)


def _runs(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
