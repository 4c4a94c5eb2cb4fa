"""Every example runs as a script of its own, from an empty folder, and is short."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NEEDS = {"export_to_mujoco": "mujoco", "machine_in_mujoco": "mujoco", "machines_for_learning": "mujoco"}
"""Packages that an example needs and gtpin does not."""


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
@pytest.mark.study
def test_an_example_runs_and_tells_something(example: Path, tmp_path: Path) -> None:
    if example.stem in NEEDS:
        pytest.importorskip(NEEDS[example.stem])
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    ran = subprocess.run(
        [sys.executable, str(example)], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_says_what_it_is_about(example: Path) -> None:
    text = example.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 60
    assert text.startswith('"""')


GIVEN = (
    "benchmark/publish.py",
    "benchmark/record.py",
    "blind/page.py",
    "machines/chains.py",
    "jugglebot/cross_validate.py",
    "machines/scores.py",
    "real/signs.py",
)
"""Scripts that can do nothing without being told what with."""


@pytest.mark.parametrize("script", GIVEN)
def test_a_script_that_needs_arguments_says_so_in_one_line(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = ROOT / "examples" / script
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(path)])
    monkeypatch.syspath_prepend(path.parent)
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr() == ("", "")
    told = ended.value.code
    assert isinstance(told, str)  # Python prints it to standard error, and ends with 1
    assert len(told.splitlines()) == 1
    assert path.name in told
    assert list(tmp_path.iterdir()) == []


def test_no_other_script_takes_an_argument_for_granted() -> None:
    for script in (ROOT / "examples").glob("*/*.py"):
        text = script.read_text(encoding="utf-8")
        assert "len(sys.argv)" in text or "sys.argv[1]" not in text, script.name
