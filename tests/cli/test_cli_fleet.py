"""``gtpin diagnose A B C``: a folder for each dataset, one table of all, and none that stops the others."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from ran import called, everything, refused

from gtpin.commands import fleet

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


@pytest.fixture(scope="module")
def machines(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two machines with datasets of one name, and one whose description lacks the robot."""
    folder = tmp_path_factory.mktemp("machines")
    for name in ("a", "b"):
        shutil.copytree(source, folder / name / "set")
    (folder / "c").mkdir()
    (folder / "c" / "dataset.toml").write_text('schema = "gtpin-dataset/1"\n')
    return folder


@pytest.fixture(scope="module")
def told(machines: Path) -> dict[str, object]:
    """What the command writes with one process, what it prints, and how it ends."""
    paths = [machines / "a" / "set", machines / "c", machines / "b" / "set"]
    ran = called("diagnose", *paths, "-o", machines / "out", "--json")
    return {"paths": paths, "ran": ran, "content": json.loads((machines / "out" / "fleet.json").read_text())}


def test_a_dataset_that_fails_is_a_row_with_its_error_and_the_others_are_diagnosed(told, machines) -> None:
    rows = told["content"]["datasets"]
    assert told["ran"].code == 2
    assert json.loads(told["ran"].out) == told["content"]
    assert [row["dataset"] for row in rows] == [str(machines / name) for name in ("a/set", "c", "b/set")]
    assert [row["folder"] for row in rows] == ["a-set", f"{machines.name}-c", "b-set"]
    assert [row["error"] is None for row in rows] == [True, False, True]
    assert "robot" in rows[1]["error"]
    assert rows[0]["verdict"] == "none"
    assert rows[0]["rows"]["used"] == rows[0]["rows"]["of"] >= 60
    page = (machines / "out" / "fleet.html").read_text()
    assert "a-set" in page
    assert "the key is missing" in rows[1]["error"]
    assert "the key is missing" in page


def test_each_folder_has_what_a_diagnosis_of_this_dataset_alone_writes(told, machines) -> None:
    assert called("diagnose", machines / "a" / "set", "-o", machines / "alone").code == 0
    alone, one = everything(machines / "alone"), everything(machines / "out" / "a-set")
    assert {name: text for name, text in alone.items() if name.endswith(".json")} == {
        name: text for name, text in one.items() if name.endswith(".json")
    }
    assert alone.keys() == one.keys()
    assert {path.name for path in (machines / "out").iterdir() if path.is_dir()} == {"a-set", "b-set"}


@pytest.mark.slow
def test_with_several_processes_the_table_is_the_same(told, machines) -> None:
    again = called("diagnose", *told["paths"], "-o", machines / "two", "--jobs", 2)
    assert again.code == 2
    assert (machines / "two" / "fleet.json").read_bytes() == (machines / "out" / "fleet.json").read_bytes()
    assert "Written" in again.out


def test_a_folder_is_named_by_as_many_parts_of_the_path_as_it_takes() -> None:
    names = fleet._names([Path("/m/one/set"), Path("/m/two/set"), Path("/n/two/set")])
    assert names == ["m-one-set", "m-two-set", "n-two-set"]
    assert fleet._names([Path("/m/one"), Path("/m/two")]) == ["one", "two"]


def test_what_has_no_meaning_is_refused_before_any_work(machines, tmp_path) -> None:
    a, b, out = machines / "a" / "set", machines / "b" / "set", tmp_path / "out"
    assert "--jobs" in refused(tmp_path, "diagnose", a, "-o", out, "--jobs", 2)
    assert "given twice" in refused(tmp_path, "diagnose", a, a, "-o", out)
    many = refused(tmp_path, "diagnose", a, b, "-o", out, "--against", a, "--history", tmp_path / "log.html")
    assert "--history" in many
    assert "scheduler" in refused(tmp_path, "diagnose", a, b, "-o", out, "--cluster", "tcp://127.0.0.1:1")
