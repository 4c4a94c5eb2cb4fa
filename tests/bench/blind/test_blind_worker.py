"""The process that diagnoses: what it knows, and what becomes of one that dies."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from handmade import Quiet, canned
from probes import dying, known_modules, plant_imported

import gtpin.bench.blind.run
from gtpin.bench.blind.folder import CheckFolder
from gtpin.bench.blind.run import check_given
from gtpin.bench.blind.score import score
from gtpin.bench.blind.worker import diagnose_alone
from gtpin.errors import GtpinError
from gtpin.spread import spread, workers

PACKAGE = Path(__file__).parents[3] / "gtpin"


@pytest.mark.slow
def test_the_worker_does_not_import_the_plant() -> None:
    code = "import sys, gtpin.bench.blind.worker; print([m for m in sys.modules if m.startswith('gtpin.bench.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['gtpin.bench.blind', 'gtpin.bench.blind.worker']"


@pytest.mark.slow
def test_what_is_said_of_a_case_has_no_name_of_a_folder_that_is_another_one_each_time() -> None:
    code = "from gtpin.bench.blind.worker import diagnose_alone as d; print(d({'dataset.toml': b'nonsense'})[0].error)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("dataset/dataset.toml: not TOML")


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
    monkeypatch.setattr("gtpin.spread.processes", lambda: 2)
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
from gtpin.bench.blind.run import check_given
from gtpin.bench.blind.score import score
from gtpin.spread import spread, workers
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


# The same work on a dask cluster: a scheduler and two workers on this machine.
OF_DASK = pytest.mark.filterwarnings("ignore")


@pytest.mark.slow
@OF_DASK
@pytest.mark.usefixtures("here")
def test_a_cluster_gives_the_same_score(cases: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    local = check_given(tmp_path / "local", cases, Quiet())
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tcp://")
        far = check_given(tmp_path / "far", cases, Quiet(), address)
    assert score(far.cases) == score(local.cases)


@pytest.mark.slow
@OF_DASK
def test_a_scheduler_that_does_not_answer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("gtpin.spread.CONNECT", 1)
    for address in ("tcp://127.0.0.1:9", "nonsense"):
        with pytest.raises(GtpinError, match="no dask scheduler at"), workers(address):
            spread(canned, [], lambda _: (), lambda *_: None)


@OF_DASK
def test_a_cluster_without_workers_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")

    class Lonely:
        """Answers for a scheduler that has no workers."""

        def __init__(self, address: str, timeout: float) -> None:
            self.closed = False

        def __enter__(self) -> "Lonely":
            return self

        def __exit__(self, *_: object) -> None:
            self.closed = True

        def scheduler_info(self) -> dict[str, dict[str, object]]:
            return {"workers": {}}

    monkeypatch.setattr(distributed, "Client", Lonely)
    with pytest.raises(GtpinError, match="has no workers"), workers("tcp://127.0.0.1:8786"):
        pass
