"""``gtpin diagnose --against`` and ``gtpin plan``: what they write and print, and how they refuse."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case, measure_at
from gtpin.data import Commands

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model, and ten poses of a later day on which the second zero has moved by 0.1 mm."""
    made = tmp_path_factory.mktemp("health")
    case = make_case(31, effects=[], poses=120, held_out=10, background=False)
    gtpin.calibrate(case.dataset).save(made / "model")
    q = case.dataset.q[:10]
    ways = {f"approach{i + 1}": np.resize([1.0, -1.0], 10) for i in range(3)}
    ids = np.array([f"c{i}" for i in range(10)], dtype=object)
    moved = measure_at(case, Commands(ids, q + np.array([0.0, 1e-4, 0.0]), ways), 1)
    replace(moved, q=q).write(made / "today")
    return made


@pytest.mark.slow
def test_a_check_writes_what_a_diagnosis_writes_and_adds_itself_to_the_log(run, folder, tmp_path):
    done = run(
        "diagnose", folder / "today", "--against", folder / "model", "-o", tmp_path / "o", "--history", tmp_path / "log"
    )
    assert done.code == 0, done.err
    told = json.loads((tmp_path / "o" / "diagnosis.json").read_text())
    assert told["causes"][0]["effect"] == "zero_shift"
    assert "zero shift" in done.out
    assert str(tmp_path / "log" / "history.html") in done.out
    assert gtpin.read_model(tmp_path / "o").effects[0].name == "zero_shift@cart2"
    page = (tmp_path / "o" / "report.html").read_text()
    assert "What could not be tested" in page
    poses = run("predict", tmp_path / "o", folder / "today" / "poses.csv", "-o", tmp_path / "p.csv")
    assert poses.code == 0, poses.err


@pytest.mark.slow
def test_a_plan_is_a_table_that_predict_reads_and_is_repeatable(run, folder, tmp_path):
    for name in ("a", "b"):
        done = run("plan", folder / "model", "--for", "health", "--poses", 6, "-o", tmp_path / name)
        assert done.code == 0, done.err
    for name in ("commands.csv", "plan.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert json.loads((tmp_path / "a" / "plan.json").read_text())["schema"] == "gtpin-plan/1"
    poses = run("predict", folder / "model", tmp_path / "a" / "commands.csv", "-o", tmp_path / "p.csv")
    assert poses.code == 0, poses.err


@pytest.mark.slow
def test_compare_with_a_model_and_a_dataset_names_the_command_that_is_meant(run, folder, tmp_path):
    words = run("compare", folder / "model", folder / "today", "-o", tmp_path / "o").failed()
    assert "gtpin diagnose" in words
    assert "--against" in words


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--history", "log"], "--against"),
        (["--against", "nowhere"], "nowhere"),
        (["--against", "MODEL", "--hold-out", "random"], "--hold-out"),
        (["--against", "MODEL", "--exclude", "rust"], "rust"),
        (["--against", "MODEL", "--why", "backlash@cart1"], "earlier model"),
    ],
)
def test_what_can_not_be_is_one_line(run, folder, tmp_path, options, words):
    given = [str(folder / "model") if option == "MODEL" else option for option in options]
    assert words in run("diagnose", folder / "today", *given, "-o", tmp_path / "o").failed()
    assert not (tmp_path / "o").exists()


def test_a_check_measured_in_another_frame_than_the_model_is_one_line(run, folder, tmp_path):
    model = gtpin.read_model(folder / "model")
    gtpin.write_model(replace(model, frame=gtpin.Frame(np.array([1.0, 0.0, 0.0]))), tmp_path / "free")
    words = run("diagnose", folder / "today", "--against", tmp_path / "free", "-o", tmp_path / "o").failed()
    assert 'frame = "free"' in words


@pytest.mark.slow
def test_a_model_of_an_older_version_is_taken_with_a_warning(run, folder, tmp_path):
    old = tmp_path / "old"
    gtpin.write_model(replace(gtpin.read_model(folder / "model"), fit=None), old)
    assert '"fit"' not in (old / "model.json").read_text()
    done = run("diagnose", folder / "today", "--against", old, "-o", tmp_path / "o")
    assert done.code == 0, done.err
    assert "scatter of the drives" in done.err


def test_a_damaged_history_ends_the_command_before_any_result(run, folder, tmp_path):
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "history.jsonl").write_text("{}\n")
    given = ("--against", folder / "model", "-o", tmp_path / "o", "--history", tmp_path / "log")
    assert "damaged" in run("diagnose", folder / "today", *given).failed()
    assert not (tmp_path / "o").exists()
