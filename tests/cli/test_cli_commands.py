"""What each command writes and prints."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import gtpin
from gtpin.bench.commands.demo import DemoRobot
from gtpin.data import Dataset

README = Path(__file__).parents[2] / "README.md"

NUMBER = "#"
COMMANDS = "pose,q1,q2,q3\nb,0.1,0.2,0.3\na,0,0,0\n7,-0.1,0.05,0.2\n"


def test_calibrate_writes_the_model_and_its_numbers(calibrated, source):
    assert {path.name for path in calibrated.iterdir()} >= {"model", "calibration.json"}
    assert {path.name for path in (calibrated / "model").iterdir()} >= {"model.json", "robot.urdf"}
    told = json.loads((calibrated / "calibration.json").read_text())
    assert told["schema"] == "gtpin-calibration/1"
    assert len(told["parameters"]) == 48
    assert told["poses"] == len(Dataset.read(source))
    assert 0.7 < told["chi2_per_dof"] < 1.3
    model = gtpin.read_model(calibrated)
    assert {p["name"]: p["value"] for p in told["parameters"]} == dict(
        zip(model.geometry.names, model.geometry.values, strict=True)
    )


@pytest.mark.slow
def test_calibrate_predicts_what_it_was_not_shown(run, tmp_path):
    made = run("simulate", "-o", tmp_path / "set", "--poses", "100", "--seed", "4", "--truth")
    assert made.code == 0
    assert run("calibrate", tmp_path / "set", "-o", tmp_path / "out").code == 0
    assert run("predict", tmp_path / "out", tmp_path / "set" / "commands.csv", "-o", tmp_path / "p.csv").code == 0
    truth, found = pd.read_csv(tmp_path / "set" / "truth.csv"), pd.read_csv(tmp_path / "p.csv")
    assert list(found.columns) == ["pose", "x", "y", "z", "qw", "qx", "qy", "qz"]
    off = np.sqrt(((found[["x", "y", "z"]] - truth[["x", "y", "z"]]) ** 2).sum(axis=1).mean())
    assert off < 15e-6  # the noise's length is 26 um; 100 poses leave a third of it
    dots = (found[["qw", "qx", "qy", "qz"]] * truth[["qw", "qx", "qy", "qz"]]).sum(axis=1)
    assert (np.abs(dots) > 1.0 - 1e-8).all()


def test_calibrate_holds_frees_and_adds_parameters_by_name(run, source, tmp_path):
    words = ("--fix", "length[2a]=2.0431", "--free", "length[1]", "--zeros", "--json")
    ran = run("calibrate", source, "-o", tmp_path / "out", *words)
    assert ran.code == 0, ran.err
    found = json.loads(ran.out)
    assert found["held"] == {"length[2a]": 2.0431}
    tolerance = {p["name"]: p["tolerance"] for p in found["parameters"]}
    assert (tolerance["length[1]"], tolerance["zero[cart3]"]) == (1.0, 0.1)
    ran = run("calibrate", source, "-o", tmp_path / "no", "--fix", "length[2a]")
    assert "give NAME=VALUE" in ran.failed()
    assert "did you mean length[" in run("calibrate", source, "-o", tmp_path / "no", "--free", "length[2]").failed()


@pytest.mark.parametrize("command", ["calibrate", "predict", "simulate"])
def test_json_prints_the_result_and_nothing_else(run, source, calibrated, tmp_path, command):
    arguments = {
        "calibrate": [source, "-o", tmp_path / "out"],
        "predict": [calibrated, source / "commands.csv", "-o", tmp_path / "p.csv"],
        "simulate": ["-o", tmp_path / "sim", "--poses", "12"],
    }[command]
    ran = run(command, *arguments, "--json")
    assert ran.code == 0
    assert ran.err == ""
    told = json.loads(ran.out)
    if command == "calibrate":
        assert told == json.loads((tmp_path / "out" / "calibration.json").read_text())
    if command == "predict":
        assert [row["pose"] for row in told] == [str(p) for p in pd.read_csv(tmp_path / "p.csv")["pose"]]


def test_without_json_people_are_told_what_was_written(calibration):
    ran = calibration[1]
    assert ran.code == 0
    assert ran.err == ""
    assert "calibration.json" in ran.out
    assert "chi-square" in ran.out


def test_simulate_writes_a_dataset_that_reads_and_calibrates(run, tmp_path):
    assert run("simulate", "-o", tmp_path / "set", "--poses", "30", "--seed", "2").code == 0
    dataset = Dataset.read(tmp_path / "set")
    assert len(set(dataset.pose)) == 30
    assert dataset.robot == "gantry_tau"
    names = {path.name for path in (tmp_path / "set").iterdir()}
    assert names == {".gtpin.json", "dataset.toml", "poses.csv", "commands.csv"}
    assert run("calibrate", tmp_path / "set", "-o", tmp_path / "out").code == 0


def test_simulate_takes_a_robot_by_its_urdf(run, tmp_path, calibrated):
    urdf = tmp_path / "own" / "machine.urdf"
    urdf.parent.mkdir()
    urdf.write_bytes((calibrated / "model" / "robot.urdf").read_bytes())
    assert run("simulate", "-o", tmp_path / "deep" / "set", "--robot", urdf, "--poses", "20").code == 0
    told = (tmp_path / "deep" / "set" / "dataset.toml").read_text()
    assert 'robot = "../../own/machine.urdf"' in told
    assert run("calibrate", tmp_path / "deep" / "set", "-o", tmp_path / "out").code == 0


@pytest.mark.slow
def test_demo_needs_nothing_but_a_folder_and_is_repeatable(run, tmp_path, monkeypatch, tree):
    monkeypatch.chdir(tmp_path)
    ran = run("demo")
    assert ran.code == 0
    assert ran.err == ""
    assert list(tmp_path.iterdir()) == [tmp_path / "gtpin-demo"]
    opened = ran.out.splitlines()[-1].removeprefix("Open ")
    assert opened == str(Path("gtpin-demo", "report.html"))
    assert Path(opened).read_text().startswith("<!doctype html>")
    first = tree(tmp_path / "gtpin-demo")
    for name in ("dataset/poses.csv", "dataset.truth.json", "calibration/calibration.json", "calibration/report.html"):
        assert first[name]
    assert Dataset.read("gtpin-demo/dataset").robot == "gantry_tau"
    assert gtpin.read_model("gtpin-demo").effects

    again = run("demo", "--json", "-o", "again")
    assert again.err == ""
    told = json.loads(again.out)
    assert told.items() >= json.loads((tmp_path / "again" / "diagnosis.json").read_text()).items()
    second = tree(tmp_path / "again")
    numbers = [name for name in first if name.endswith((".json", ".csv", ".toml", ".urdf"))]
    assert {name: first[name] for name in numbers} == {name: second[name] for name in numbers}

    hidden = {(effect["effect"], effect["site"]) for effect in told["truth"]["effects"]}
    assert {(cause["effect"], cause["site"]) for cause in told["causes"]} == hidden
    errors = told["truth"]["true_rms"]
    assert errors["diagnosed"] < 0.5 * errors["calibrated"] < 0.1 * errors["nominal"]


@pytest.mark.slow
def test_the_demo_of_an_arm_finds_what_its_scenario_hides_and_says_what_readme_shows(run, tmp_path):
    ran = run("demo", "--robot", "ur5", "-o", tmp_path / "arm")
    assert ran.code == 0
    assert Dataset.read(tmp_path / "arm" / "dataset").robot == "ur5"
    found, truth = (
        json.loads((tmp_path / "arm" / name).read_text()) for name in ("diagnosis.json", "dataset.truth.json")
    )
    hidden = {(effect["effect"], effect["site"]) for effect in truth["effects"]}
    classes = [{(other["effect"], other["site"]) for other in cause["class"]} for cause in found["causes"]]
    assert len(classes) == len(hidden)  # nothing else is named
    assert hidden <= set().union(*classes)
    periodic = next(cause["parameters"] for cause in found["causes"] if cause["effect"] == "rack_periodic")
    asked = next(effect["periods"] for effect in tomllib.loads(DemoRobot.UR5.scenario.read_text())["effect"])
    turns = sorted(2.0 * np.pi / periodic[name]["value"] for name in periodic if name.startswith("period"))
    assert np.allclose(turns, asked, rtol=0.01)

    shown = re.findall(r"^```text\n\$ gtpin demo --robot ur5\n(.*?)^```$", README.read_text(), re.MULTILINE | re.DOTALL)
    told = words_and_numbers(ran.out)
    for part in shown[0].split("\n\n"):
        words, numbers = words_and_numbers(part)
        assert words in told[0]
        begin = told[0][: told[0].index(words)].count(NUMBER)
        points = np.array([word == "%" for word in re.findall(rf"{NUMBER}(?: (%))?", words)])  # rounded to 1 %
        off = np.abs(np.array(told[1][begin : begin + len(numbers)]) - numbers)
        assert (off <= np.where(points, 1.0, 0.01 * np.abs(numbers))).all()


def words_and_numbers(text):
    """The text with a mark for each number, and the numbers: machines' linear algebra differ in the last digits."""
    number = r"[−-]?\d+(?:\.\d+)?"
    plain = " ".join(text.split())
    return re.sub(number, NUMBER, plain), [float(found.replace("−", "-")) for found in re.findall(number, plain)]


def test_a_demo_of_a_robot_without_a_scenario_says_which_have_one(run, tmp_path):
    ran = run("demo", "--robot", "panda", "-o", tmp_path / "arm")
    ran.failed(2)
    assert "gantry_tau" in ran.err
    assert not (tmp_path / "arm").exists()


@pytest.mark.slow
@pytest.mark.parametrize("command", ["simulate", "calibrate", "predict"])
def test_the_same_seed_gives_the_same_bytes(run, source, calibrated, tmp_path, tree, command):
    arguments = {
        "simulate": ["--poses", "15", "--seed", "5", "--truth"],
        "calibrate": [source],
        "predict": [calibrated, source / "commands.csv"],
    }[command]
    outputs = []
    for name in ("one", "two"):
        target = tmp_path / name / ("p.csv" if command == "predict" else "result")
        assert run(command, *arguments, "-o", target).code == 0
        files = tree(tmp_path / name)
        outputs.append({k: v for k, v in files.items() if k.endswith((".json", ".csv", ".urdf", ".toml"))})
    assert outputs[0] == outputs[1]
    assert outputs[0]


def test_another_seed_gives_another_machine_and_it_is_nought_by_default(run, tmp_path, tree):
    for name, seed in (("default", []), ("0", ["--seed", "0"]), ("1", ["--seed", "1"])):
        assert run("simulate", "-o", tmp_path / name, "--poses", "10", *seed).code == 0
    assert tree(tmp_path / "default") == tree(tmp_path / "0")
    assert tree(tmp_path / "default")["poses.csv"] != tree(tmp_path / "1")["poses.csv"]


@pytest.mark.parametrize("kind", ["name", "urdf", "folder", "output"])
def test_predict_takes_a_name_a_urdf_a_model_folder_and_an_output_folder(run, calibrated, tmp_path, kind):
    model = {
        "name": "gantry_tau",
        "urdf": calibrated / "model" / "robot.urdf",
        "folder": calibrated / "model",
        "output": calibrated,
    }[kind]
    (tmp_path / "c.csv").write_text(COMMANDS)
    assert run("predict", model, tmp_path / "c.csv", "-o", tmp_path / "p.csv").code == 0
    found = pd.read_csv(tmp_path / "p.csv", dtype={"pose": str})
    assert list(found["pose"]) == ["b", "a", "7"]  # in the order given
    q = pd.read_csv(tmp_path / "c.csv")[["q1", "q2", "q3"]].to_numpy()
    expected = gtpin.read_model(calibrated if kind != "name" else "gantry_tau").predict(q)
    assert np.abs(found[["x", "y", "z"]].to_numpy() - expected.T).max() < 1e-9
    assert kind == "urdf" or np.array_equal(found[["x", "y", "z"]].to_numpy(), expected.T)  # to the last digit
    norms = np.linalg.norm(found[["qw", "qx", "qy", "qz"]].to_numpy(), axis=1)
    np.testing.assert_allclose(norms, 1.0, atol=1e-12)
    assert (np.abs((found[["qw", "qx", "qy", "qz"]].to_numpy() * expected.quaternions).sum(axis=1)) > 1 - 1e-12).all()


@pytest.mark.slow
def test_predict_answers_in_the_instrument_s_frame(run, dataset, tmp_path):
    toml = (dataset / "dataset.toml").read_text()
    (dataset / "dataset.toml").write_text(toml.replace('frame = "robot"', 'frame = "free"'))
    frame = pd.read_csv(dataset / "poses.csv")
    x, y = frame["x"].copy(), frame["y"].copy()
    frame["x"], frame["y"], frame["z"] = -y + 20.0, x - 3.0, frame["z"] + 1.0  # a quarter turn about z, and a shift
    half = np.sqrt(0.5)
    w, i, j, k = (frame[c].copy() for c in ("qw", "qx", "qy", "qz"))
    frame["qw"], frame["qx"], frame["qy"], frame["qz"] = half * (w - k), half * (i - j), half * (i + j), half * (w + k)
    frame.to_csv(dataset / "poses.csv", index=False)
    assert run("calibrate", dataset, "-o", tmp_path / "out").code == 0
    assert run("predict", tmp_path / "out", dataset / "poses.csv", "-o", tmp_path / "p.csv").code == 0
    found = pd.read_csv(tmp_path / "p.csv")
    assert np.abs(found[["x", "y", "z"]] - frame[["x", "y", "z"]]).max(axis=None) < 8 * 15e-6


@pytest.mark.slow
def test_the_program_works_from_end_to_end_and_its_piped_output_has_neither_colour_nor_progress(program, tmp_path):
    """As people run it: relative paths, one process after the other."""
    for arguments in (
        ["simulate", "-o", "set", "--poses", "20"],
        ["calibrate", "set", "-o", "out"],
        ["predict", "out", "set/commands.csv", "-o", "p.csv"],
        ["predict", "out", "set/commands.csv", "-o", "new/folder/p.csv"],
    ):
        ran = program(*arguments, cwd=tmp_path)
        assert ran.code == 0, ran.err
        assert ran.err == ""
        assert not {"\x1b", "\r"} & set(ran.out)
    assert (tmp_path / "p.csv").read_bytes() == (tmp_path / "new" / "folder" / "p.csv").read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {".gtpin.json", "set", "out", "p.csv", "new"}
