"""The command line, run in this process or as a program of its own, and datasets to run it on."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
from ran import Ran, everything

import gtpin
import gtpin.cli
from gtpin.bench.simulator.simulate import simulate

Run = Callable[..., Ran]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run gtpin in this process."""

    def run_(*arguments: object) -> Ran:
        monkeypatch.setattr(sys, "argv", ["gtpin", *map(str, arguments)])
        capsys.readouterr()
        with warnings.catch_warnings(), pytest.raises(SystemExit) as ended:
            gtpin.cli.main()
        out, err = capsys.readouterr()
        return Ran(int(ended.value.code or 0), out, err)

    return run_


@pytest.fixture(scope="session")
def program() -> Run:
    """Run gtpin as a program of its own."""

    def run_(*arguments: object, cwd: Path | None = None, **environment: str) -> Ran:
        import os

        code = "import gtpin.cli; gtpin.cli.main()"
        done = subprocess.run(
            [sys.executable, "-c", code, *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=cwd,
            env={**os.environ, "PYTHONPATH": str(Path(gtpin.__file__).parents[1]), **environment},
            timeout=900,  # against a hang; a busy machine is slow
        )
        return Ran(done.returncode, done.stdout, done.stderr)

    return run_


@pytest.fixture(scope="session")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of 60 poses, each visited once, with commands.csv beside it; not to be changed."""
    folder = tmp_path_factory.mktemp("source") / "set"
    found = simulate(gtpin.load_robot("gantry_tau"), "gantry_tau", poses=60, held_out=20)
    found.dataset.write(folder)
    found.commands.write(folder / "commands.csv")
    return folder


@pytest.fixture(scope="session")
def calibrated(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What ``gtpin calibrate`` makes of the dataset; not to be changed."""
    folder = tmp_path_factory.mktemp("result") / "calibrated"
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        patch.setattr(sys, "argv", ["gtpin", "calibrate", str(source), "-o", str(folder)])
        with pytest.raises(SystemExit) as ended:
            gtpin.cli.main()
    assert not ended.value.code
    return folder


@pytest.fixture
def dataset(source: Path, tmp_path: Path) -> Path:
    """A copy of the dataset, to be spoilt."""
    folder = tmp_path / "set"
    folder.mkdir()
    for file in source.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    return folder


@pytest.fixture(scope="session")
def tree() -> Callable[[Path], dict[str, bytes | None]]:
    """All files under a folder with their bytes, and all folders with None."""
    return everything
