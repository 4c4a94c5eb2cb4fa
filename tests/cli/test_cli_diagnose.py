"""``gtpin diagnose``: what it writes and prints, that its models predict, and how it refuses."""

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from ran import called, refused

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.data import Dataset
from gtpin.output.shown import present

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # what a plant holds constant is noticed
SAMPLES = Path(__file__).parents[3] / "shared" / "samples"
KEYS = {"schema", "verdict", "causes", "candidates", "where", "gap", "unexplained", "next_experiment"} | {
    "warnings",
    "also",
    "rows",
}


def made(folder, *effects):
    """A plant's dataset of 120 poses with effects so strong that they can't be missed; the truth beside it."""
    case = make_case(11, effects=[(name, site) for name, site in effects], noncentrality=4000.0, poses=120)
    case.write(folder, "set")
    return folder / "set"


@pytest.fixture(scope="module")
def strong(tmp_path_factory):
    """A machine whose first drive has a lot of play."""
    return made(tmp_path_factory.mktemp("strong"), ("backlash", "cart1"))


@pytest.fixture(scope="module")
def diagnosed(strong, tmp_path_factory):
    """What ``gtpin diagnose`` makes of it, not to be changed, and how it ended."""
    folder = tmp_path_factory.mktemp("result") / "deep" / "diagnosis"
    return folder, called("diagnose", strong, "-o", folder)


def told(folder):
    return json.loads((folder / "diagnosis.json").read_text())


def errors(folder, dataset):
    """(N,) position errors of predictions, m, against the plant's truth."""
    truth = pd.read_csv(dataset.with_name("set.truth.csv"))
    found = pd.read_csv(folder)
    assert len(found) == len(truth)
    return np.linalg.norm(found[["x", "y", "z"]].to_numpy() - truth[["x", "y", "z"]].to_numpy(), axis=1)


def test_diagnose_writes_two_models_their_numbers_and_a_page(diagnosed):
    folder, ran = diagnosed
    assert ran.code == 0, ran.err
    names = {".gtpin.json", "baseline", "model", "diagnosis.json", "report.html", "next_experiment"}
    assert {path.name for path in folder.iterdir()} == names
    assert set(told(folder)) == KEYS
    assert "</html>" in (folder / "report.html").read_text()
    assert {path.name for path in folder.parent.iterdir()} == {"diagnosis"}


def test_diagnose_names_what_the_plant_has(diagnosed):
    found = told(diagnosed[0])
    assert found["verdict"] in ("explained", "ambiguous")
    leader = found["causes"][0]
    assert {"effect": "backlash", "site": "cart1"} in [{k: m[k] for k in ("effect", "site")} for m in leader["class"]]


def test_people_are_told_verdict_causes_gap_and_which_file_to_open(diagnosed):
    folder, ran = diagnosed
    found = told(folder)
    lines = ran.out.rstrip("\n").splitlines()
    assert "nominal geometry" in lines[1]
    assert any(line.startswith("cart1: ") for line in lines)
    for cause in found["causes"]:
        assert any(cause["site"] in line and cause["effect"] in line for line in lines)
    for value in ("position_rms_before", "position_rms_after", "noise_floor"):
        assert f"{found['gap'][value] * 1e6:.1f} µm" in ran.out.replace("\u00a0", " ")
    assert f"gtpin export {folder} -o corrected.urdf" in ran.out
    assert lines[-1] == f"Open {folder / 'report.html'}"
    assert "\x1b" not in ran.out
    assert all(line.startswith("gtpin: warning: ") for line in ran.err.splitlines())


def test_what_to_measure_next_is_a_table_that_can_be_predicted(run, diagnosed, tmp_path):
    folder, _ = diagnosed
    steps = told(folder)["next_experiment"]
    tables = [folder / "next_experiment" / f"{i + 1}.csv" for i, step in enumerate(steps) if step["poses"]]
    assert tables
    assert sorted(tables) == sorted((folder / "next_experiment").glob("*.csv"))
    for table, step in zip(tables, (step for step in steps if step["poses"]), strict=True):
        commands = gtpin.Commands.read(table, 3)
        np.testing.assert_allclose(commands.q, step["poses"])
        assert set(commands.covariates) >= set(step["covariates"])
        assert run("predict", folder, table, "-o", tmp_path / table.name).code == 0


def test_the_model_with_the_causes_predicts_better_than_the_one_without(run, diagnosed, strong, tmp_path):
    folder, _ = diagnosed
    rms = {}
    for name, model in {"after": folder, "before": folder / "baseline"}.items():
        assert run("predict", model, strong / "commands.csv", "-o", tmp_path / f"{name}.csv").code == 0
        rms[name] = np.sqrt((errors(tmp_path / f"{name}.csv", strong) ** 2).mean())
    assert rms["after"] < 0.7 * rms["before"]
    assert gtpin.read_model(folder).effects
    assert not gtpin.read_model(folder / "baseline").effects


def test_a_covariate_that_the_causes_need_is_asked_for_and_by_the_baseline_is_not(run, diagnosed, strong, tmp_path):
    folder, _ = diagnosed
    commands = pd.read_csv(strong / "commands.csv", dtype={"pose": str}).drop(columns="approach1")
    commands.to_csv(tmp_path / "c.csv", index=False)
    error = refused(tmp_path, "predict", folder, tmp_path / "c.csv", "-o", tmp_path / "deep" / "p.csv")
    assert "c.csv, column approach1" in error
    assert "backlash@cart1" in error
    assert run("predict", folder / "baseline", tmp_path / "c.csv", "-o", tmp_path / "p.csv").code == 0


@pytest.fixture(scope="module")
def again(strong):
    """The same data diagnosed once more, in Python."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return gtpin.diagnose(Dataset.read(strong))


@pytest.mark.slow
def test_the_same_data_twice_give_the_same_bytes(diagnosed, again, strong, tmp_path, tree):
    folder, _ = diagnosed
    present(again).write(tmp_path)
    first, second = tree(folder), tree(tmp_path)
    names = [name for name in first if name.endswith((".json", ".urdf", ".csv")) and not name.endswith(".gtpin.json")]
    assert {"diagnosis.json", "model/model.json", "baseline/model.json"} <= set(names)
    assert [name for name in names if first[name] != second[name]] == []


@pytest.mark.slow
def test_json_prints_the_result_and_nothing_else(run, diagnosed, again, strong, tmp_path, monkeypatch):
    monkeypatch.setattr("gtpin.commands.diagnose.run_diagnosis", lambda *_, **__: again)
    ran = run("diagnose", strong, "-o", tmp_path / "out", "--json")
    assert ran.code == 0
    assert json.loads(ran.out) == told(diagnosed[0])
    assert all(line.startswith("gtpin: warning: ") for line in ran.err.splitlines())


@pytest.mark.slow
def test_why_one_cause_is_not_named_is_said_on_the_first_screen_on_the_page_and_in_the_numbers(run, strong, tmp_path):
    ran = run("diagnose", strong, "-o", tmp_path / "out", "--why", "servo_lag@cart1")
    assert ran.code == 0, ran.err
    found = told(tmp_path / "out")
    assert set(found) == KEYS | {"why"}
    why = found["why"]
    assert why["standing"] != "named"
    for shown in (ran.out, (tmp_path / "out" / "report.html").read_text()):
        assert "servo_lag at cart1: not named" in " ".join(shown.split())
    assert why["position_rms_after"] == why["left_out"]["alone"] > 0.0
    step = why["next_experiment"]
    assert "servo_lag@cart1" in found["next_experiment"][step]["separates"]
    assert (
        not found["next_experiment"][step]["poses"]
        or (tmp_path / "out" / "next_experiment" / f"{step + 1}.csv").exists()
    )


@pytest.mark.parametrize("word", ["backlsh@cart1", "backlash@cart7", "backlash"])
def test_an_unknown_name_after_why_is_one_line_with_the_nearest(run, strong, tmp_path, word):
    assert "backlash@cart1" in run("diagnose", strong, "-o", tmp_path / "deep" / "out", "--why", word).failed()
    assert not (tmp_path / "deep").exists()


@pytest.mark.slow
def test_what_is_excluded_is_neither_named_nor_considered(run, strong, tmp_path):
    ran = run("diagnose", strong, "-o", tmp_path / "out", "--exclude", "backlash@cart1", "--exclude", "servo_lag")
    assert ran.code == 0, ran.err
    found = told(tmp_path / "out")
    left = {(c["effect"], c["site"]) for c in found["candidates"]}
    assert ("backlash", "cart1") not in left
    assert ("backlash", "cart2") in left
    assert not [site for effect, site in left if effect == "servo_lag"]
    named = {(m["effect"], m["site"]) for cause in found["causes"] for m in cause["class"]}
    assert named <= left
    assert found["verdict"] != "none"


@pytest.mark.slow
def test_without_an_effect_nothing_is_named(run, tmp_path):
    dataset = made(tmp_path)
    ran = run("diagnose", dataset, "-o", tmp_path / "out")
    assert ran.code == 0, ran.err
    found = told(tmp_path / "out")
    assert (found["verdict"], found["causes"]) == ("none", [])
    assert (found["gap"]["shrinkage"], found["gap"]["interval"]) == (None, None)
    assert "No cause beside the geometry" in ran.out
    model, baseline = (gtpin.read_model(tmp_path / "out" / name) for name in ("model", "baseline"))
    q = Dataset.read(dataset).q
    assert not model.effects
    assert (
        np.abs(model.predict(q).minus(baseline.predict(q)))[:, :3].max() < 2e-6
    )  # both are the same geometry, fitted twice


@pytest.mark.parametrize("words", ["gremlin", "backlash@arm", ""])
def test_excluding_what_is_no_effect_is_refused(run, strong, tmp_path, words):
    assert repr(words) in run("diagnose", strong, "-o", tmp_path / "deep" / "out", "--exclude", words).failed()
    assert not (tmp_path / "deep").exists()


@pytest.mark.parametrize("value", ["0", "1", "-0.1", "nan", "often"])
def test_a_false_alarm_rate_that_can_t_be_is_refused(run, strong, tmp_path, value):
    assert "--false-alarm" in run("diagnose", strong, "-o", tmp_path / "out", "--false-alarm", value).failed()


@pytest.mark.slow
def test_wrong_datasets_are_refused_and_leave_nothing(strong, tmp_path):
    dataset = tmp_path / "set"
    replace(Dataset.read(strong), position=Dataset.read(strong).position * 1000.0).write(dataset)
    (tmp_path / "taken").write_text("mine")
    for given, out, said in (
        (dataset, "deep/out", "millimetres"),
        (tmp_path / "no", "deep/out", "the folder does not exist"),
        (strong, "taken", "taken"),
    ):
        assert said in refused(tmp_path, "diagnose", given, "-o", tmp_path / out)


@pytest.mark.slow
def test_a_disk_that_is_full_leaves_nothing(run, again, strong, tmp_path, tree, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("gtpin.commands.diagnose.run_diagnosis", lambda *_, **__: again)
    monkeypatch.setattr("pathlib.Path.write_text", full)
    assert "No space" in run("diagnose", strong, "-o", tmp_path / "deep" / "out").failed()
    assert tree(tmp_path) == {}


@pytest.mark.slow
@pytest.mark.skipif(not SAMPLES.is_dir(), reason="no samples here")
@pytest.mark.parametrize("name", ["b", "e"])
def test_the_samples_are_diagnosed_and_predicted(run, tmp_path, name):
    ran = run("diagnose", SAMPLES / name, "-o", tmp_path / "out")
    assert ran.code == 0, ran.err
    assert set(told(tmp_path / "out")) == KEYS
    commands = SAMPLES / name / "commands.csv"
    assert run("predict", tmp_path / "out", commands, "-o", tmp_path / "p.csv").code == 0
    assert len(pd.read_csv(tmp_path / "p.csv")) == len(pd.read_csv(commands))


@pytest.mark.parametrize("hold_out", ["session", "time"])
@pytest.mark.parametrize("recorded", [False, True])
def test_what_can_t_be_held_out_by_its_column_is_refused_in_one_line(hold_out, recorded, strong, tmp_path, run):
    """Where the column is missing, and where it has one value only."""
    data = Dataset.read(strong)
    covariates = {name: values for name, values in data.covariates.items() if name != hold_out}
    constant = {hold_out: np.full(len(data), "a", dtype=object) if hold_out == "session" else np.zeros(len(data))}
    replace(data, covariates=covariates | (constant if recorded else {})).write(tmp_path / "set")
    error = run("diagnose", tmp_path / "set", "-o", tmp_path / "out", "--hold-out", hold_out).failed()
    assert f"column {hold_out}" in error
    assert ("one " in error) == recorded
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_what_was_held_out_is_in_the_json_and_in_the_report(strong, tmp_path, run):
    ran = run("diagnose", strong, "-o", tmp_path / "out", "--hold-out", "time", "--seed", 3)
    assert ran.code == 0, ran.err
    method = told(tmp_path / "out")["gap"]["method"]
    assert "stretches of time left out" in method
    assert method in (tmp_path / "out" / "report.html").read_text()


@pytest.fixture(scope="module")
def bumped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eighty poses in one session, the second half of them read 0.9 mm off."""
    data = make_case(671, n_effects=0, poses=80, held_out=1).dataset
    position = data.position.copy()
    position[len(data) // 2 :] += [0.0, 8e-4, -4e-4]
    order = {name: values for name, values in data.covariates.items() if name not in ("session", "time")}
    folder = tmp_path_factory.mktemp("bumped") / "set"
    replace(data, position=position, covariates=order).write(folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("command", "file"), [("calibrate", "calibration.json"), ("diagnose", "diagnosis.json")])
def test_trusted_data_are_used_and_the_json_has_all_warnings(
    run: Any, bumped: Path, tmp_path: Path, command: str, file: str
) -> None:
    assert "bumped" in run(command, bumped, "-o", tmp_path / "refused").failed()
    ran = run(command, bumped, "-o", tmp_path / "used", "--trust-data")
    assert ran.code == 0, ran.err
    told = json.loads((tmp_path / "used" / file).read_text(encoding="utf-8"))["warnings"]
    assert any("bumped" in text for text in told)
    shown = [line.removeprefix("gtpin: warning: ") for line in ran.err.splitlines()]
    assert [" ".join(text.replace(f"{bumped}/", "").split()) for text in shown] == told
