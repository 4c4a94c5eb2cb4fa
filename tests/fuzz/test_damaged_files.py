"""Files damaged at random: every command ends with a result or one line, in time, its input untouched, nothing left behind.

The damage is that of ``examples/fuzz.py``, which goes on for hours.
"""

from __future__ import annotations

import shutil
import sys
import warnings
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

EXAMPLES = Path(__file__).parents[2] / "examples"
if sys.platform == "win32" or not EXAMPLES.is_dir():
    pytest.skip("needs the examples, and a system that forks", allow_module_level=True)
sys.path.insert(0, str(EXAMPLES))

from fuzzing.judged import contents, faults, run  # noqa: E402
from fuzzing.material import COMMANDS, make  # noqa: E402
from fuzzing.mutations import mutate, mutate_file  # noqa: E402

SECONDS = 120
"""CPU seconds after which a command on these small files hangs: a sound diagnosis takes some ten."""
TRIES = {"calibrate": 25, "diagnose": 2, "predict": 40, "sensitivity": 4, "export": 25, "simulate": 20, "view": 2}
"""Damaged files for each kind of command."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of sound files."""
    folder = tmp_path_factory.mktemp("sound")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        make(folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("kind", TRIES)
@pytest.mark.study
def test_damaged_files_end_in_a_result_or_in_one_line(sound: Path, tmp_path: Path, kind: str) -> None:
    commands = [command for command in COMMANDS if command.line.startswith(kind)]

    @settings(
        max_examples=TRIES[kind],
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(command=st.sampled_from(commands), seed=st.integers(0, 2**32))
    def damage(command, seed):
        work = tmp_path / "work"
        shutil.rmtree(work, ignore_errors=True)
        shutil.copytree(sound, work)
        rng = Random(seed)
        mutate_file(work / rng.choice(command.reads), rng)
        before = contents(work)
        ran = run(command.line, work, SECONDS)
        assert faults(ran, before, contents(work)) == []

    damage()


@pytest.mark.slow
@pytest.mark.parametrize("line", dict.fromkeys(command.line for command in COMMANDS if not command.slow))
def test_sound_files_end_in_a_result(sound: Path, tmp_path: Path, line: str) -> None:
    """Else the damage would prove nothing."""
    work = tmp_path / "work"
    shutil.copytree(sound, work)
    before = contents(work)
    ran = run(line, work, SECONDS)
    assert ran.code == 0, ran.err
    assert faults(ran, before, contents(work)) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "file", ["set/poses.csv", "parquet/poses.parquet", "own/machine.urdf", "bent/model.json", "scenario.toml"]
)
def test_damage_differs_from_seed_to_seed_and_repeats_with_one(sound: Path, file: str) -> None:
    content = (sound / file).read_bytes()
    made = [mutate(content, Path(file).suffix, Random(seed)) for seed in range(20)]
    assert len(set(made)) > 10
    assert made == [mutate(content, Path(file).suffix, Random(seed)) for seed in range(20)]
