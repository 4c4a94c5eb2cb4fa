"""The tables in docs and the log of all full runs, from a check's results."""

import csv
import datetime
import json
import re
from pathlib import Path
from types import ModuleType

import pytest
from handmade import cause, diagnosis, judged
from scripts import load

from gtpin.bench.blind.judged import Judged
from gtpin.bench.blind.score import score

SCRIPT = Path(__file__).parents[3] / "examples" / "blind" / "page.py"


@pytest.fixture
def script() -> ModuleType:
    return load("blind/page")


def run_of(folder: Path, count: int, manifest: str) -> Path:
    truth = [("linearity@cart1", 500.0, 100.0)]
    cases: list[Judged] = []
    for number in range(count):
        said = "straightness@cart1" if number % 4 == 0 else "linearity@cart1"
        cases.append(judged(f"case{number}", "one", truth, diagnosis("explained", cause(said))))
    about = {"cases": count, "seed": 3, "plant": "p" * 64, "diagnosis": "d" * 64, "manifest": manifest * 64}
    folder.mkdir()
    (folder / "score.json").write_text(json.dumps(score(cases, about)))
    (folder / "judged.json").write_text(json.dumps([case.model_dump(mode="json", exclude_none=True) for case in cases]))
    return folder


@pytest.mark.slow
def test_a_full_run_is_shown_and_logged_once(script: ModuleType, tmp_path: Path) -> None:
    log, day = tmp_path / "log.csv", datetime.date(2030, 1, 2)
    first, second = run_of(tmp_path / "one", 1000, "a"), run_of(tmp_path / "two", 1000, "b")
    for run in (first, second, first):
        script.logged(log, run, day)
    rows = list(csv.DictReader(log.read_text().splitlines()))
    assert [row["manifest"] for row in rows] == ["a" * 12, "b" * 12]
    assert rows[0]["command"] == "`gtpin blind -o DIR --cases 1000 --seed 3`"
    assert rows[0]["strict, D > 63"] == "0.750"
    files = script.files(first)
    assert files[script.FAILURES].count("straightness@cart1 named instead") == 250
    assert re.search(r"^linearity,1000,0\.750,", files[script.EFFECTS], re.MULTILINE)
    page = (SCRIPT.parents[2] / "docs" / "blind.md").read_text(encoding="utf-8")
    assert [name for name in files if f"({name})" not in page] == []


def test_a_small_run_is_not_logged(script: ModuleType, tmp_path: Path) -> None:
    script.logged(tmp_path / "log.csv", run_of(tmp_path / "one", 4, "a"), datetime.date(2030, 1, 2))
    assert not (tmp_path / "log.csv").exists()
