"""The command line, run in this process or as a program of its own, and datasets to run it on."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from ran import Ran, called, everything

import gtpin
from gtpin.bench.simulator.simulate import simulate

Run = Callable[..., Ran]


@pytest.fixture(scope="session")
def run() -> Run:
    """Run gtpin in this process."""
    return called


@pytest.fixture(scope="session")
def program() -> Run:
    """Run gtpin as a program of its own."""

    def run_(*arguments: object, cwd: Path | None = None, **environment: str) -> Ran:
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
def calibration(source: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ran]:
    """What ``gtpin calibrate`` makes of the dataset, not to be changed, and how it ended."""
    folder = tmp_path_factory.mktemp("result") / "calibrated"
    return folder, called("calibrate", source, "-o", folder)


@pytest.fixture(scope="session")
def calibrated(calibration: tuple[Path, Ran]) -> Path:
    """The folder of that calibration."""
    assert calibration[1].code == 0
    return calibration[0]


@pytest.fixture
def dataset(source: Path, tmp_path: Path) -> Path:
    """A copy of the dataset, to be spoilt."""
    return Path(shutil.copytree(source, tmp_path / "set"))


@pytest.fixture(scope="session")
def tree() -> Callable[[Path], dict[str, bytes | None]]:
    """All files under a folder with their bytes, and all folders with None."""
    return everything
