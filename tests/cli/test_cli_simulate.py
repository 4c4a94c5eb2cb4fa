"""``gtpin simulate`` with scenarios and instruments: a dataset as every other, and the truth beside it."""

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from ran import called, refused
from virtual_five_bar import urdf

from gtpin.data import Commands, Dataset

SCENARIOS = sorted((Path(__file__).parents[2] / "examples" / "scenarios").glob("*.toml"))


def results(folder):
    """Names of what is in a folder, but for gtpin's marker, which must be there."""
    names = {path.name for path in folder.iterdir()}
    assert ".gtpin.json" in names
    return names - {".gtpin.json"}


@pytest.mark.parametrize("file", SCENARIOS[::8], ids=lambda file: file.stem)  # all: test_plant_scenario.py
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # what a scenario holds constant is noticed
def test_an_example_becomes_a_dataset_with_its_truth_beside_it(run, tmp_path, file):
    ran = run("simulate", "--scenario", file, "-o", tmp_path / "deep" / "set", "--poses", "40")
    assert (ran.code, ran.err) == (0, "")
    assert results(tmp_path / "deep") == {"set", "set.truth.json", "set.truth.csv"}
    assert results(tmp_path / "deep" / "set") == {"dataset.toml", "poses.csv", "commands.csv"}
    dataset = Dataset.read(tmp_path / "deep" / "set")
    assert len(set(dataset.pose)) == 40
    commands = Commands.read(tmp_path / "deep" / "set" / "commands.csv", dataset.n_actuators)
    assert set(commands.covariates) == set(dataset.covariates)
    truth = pd.read_csv(tmp_path / "deep" / "set.truth.csv", dtype={"pose": str})
    assert list(truth.columns) == ["pose", "x", "y", "z", "qw", "qx", "qy", "qz"]
    assert list(truth["pose"]) == list(commands.pose)
    wanted = tomllib.loads(file.read_text()).get("effect", [])
    told = json.loads((tmp_path / "deep" / "set.truth.json").read_text())["effects"]
    assert sorted(e["effect"] for e in told) == sorted(e["id"] for e in wanted)
    assert {e["site"] for e in wanted if "site" in e} <= {e["site"] for e in told}


BACKLASH = next(file for file in SCENARIOS if file.stem == "backlash")


@pytest.mark.slow
def test_what_is_given_takes_precedence_over_the_scenario_and_the_same_gives_the_same_bytes(run, tmp_path, tree):
    found = {}
    for name, options in {"own": [], "again": [], "seed": ["--seed", "1"]}.items():
        assert run("simulate", "--scenario", BACKLASH, "-o", tmp_path / name / "set", *options).code == 0
        found[name] = tree(tmp_path / name)
    assert found["own"] == found["again"]
    assert found["own"]["set/poses.csv"] != found["seed"]["set/poses.csv"]
    assert len(set(Dataset.read(tmp_path / "own" / "set").pose)) == tomllib.loads(BACKLASH.read_text())["poses"]


def test_json_tells_what_was_made_but_not_what_it_has(run, tmp_path):
    ran = run("simulate", "--scenario", BACKLASH, "-o", tmp_path / "set", "--poses", "20", "--json")
    assert json.loads(ran.out) == {
        "dataset": str(tmp_path / "set"),
        "robot": "gantry_tau",
        "rows": 22,
        "seed": tomllib.loads(BACKLASH.read_text())["seed"],
    }


def test_the_truth_can_be_put_into_the_dataset_too(run, tmp_path):
    assert run("simulate", "--scenario", BACKLASH, "-o", tmp_path / "set", "--poses", "20", "--truth").code == 0
    inside, beside = (pd.read_csv(tmp_path / name) for name in ("set/truth.csv", "set.truth.csv"))
    np.testing.assert_array_equal(inside.to_numpy(), beside.to_numpy())


def test_what_else_is_in_the_folders_stays(run, tmp_path):
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "notes.txt").write_text("mine")
    (tmp_path / "thesis.txt").write_text("mine")
    assert run("simulate", "--scenario", BACKLASH, "-o", tmp_path / "set", "--poses", "20").code == 0
    assert results(tmp_path) == {"set", "set.truth.csv", "set.truth.json", "thesis.txt"}
    assert (tmp_path / "set" / "notes.txt").read_text() == "mine"
    assert (tmp_path / "set" / "poses.csv").is_file()


def test_a_robot_by_its_urdf_is_named_from_the_dataset_s_folder(run, tmp_path):
    source = Path(__file__).parents[2] / "urdf" / "gantry_tau.urdf"
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "machine.urdf").write_bytes(source.read_bytes())
    (tmp_path / "own" / "s.toml").write_text('robot = "./machine.urdf"\nposes = 20\nheld_out = 5\n')
    assert run("simulate", "--scenario", tmp_path / "own" / "s.toml", "-o", tmp_path / "deep" / "set").code == 0
    assert 'robot = "../../own/machine.urdf"' in (tmp_path / "deep" / "set" / "dataset.toml").read_text()
    assert len(set(Dataset.read(tmp_path / "deep" / "set").pose)) == 20


EFFECT = '[[effect]]\nid = "backlash"\n'
WRONG = {
    "missing": (None, "s.toml"),
    "no toml": ("poses = \n", "s.toml, row 1"),
    "bytes": (b"\xff\xfe\x00", "UTF-8"),
    "unknown key": ("colour = 1\n", "column colour"),
    "unknown effect": ('[[effect]]\nid = "gremlin"\n', "column effect.0"),
    "wrong site": (EFFECT + 'site = "arm"\n', "column effect.0"),
    "no id": ('[[effect]]\nsite = "cart1"\n', "column effect.0.id"),
    "both": (EFFECT + "energy = 100\namplitude = 1\n", "column effect.0"),
    "energy of nought": (EFFECT + "energy = 0\n", "column effect.0.energy"),
    "energy that is none": (EFFECT + "energy = nan\n", "column effect.0.energy"),
    "one pose": ("poses = 1\n", "column poses"),
    "text": ('poses = "many"\n', "column poses"),
    "noise": ("[noise]\nposition_sigma = -1.0\n", "column noise.position_sigma"),
    "covariates": ("[covariates]\nsessions = 1000\n", "column covariates.sessions"),
    "second effect": (EFFECT + '[[effect]]\nid = "linearity"\nsight = "cart1"\n', "column effect.1.sight"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_wrong_scenarios_are_refused_in_one_line_that_names_the_place(tmp_path, kind):
    content, named = WRONG[kind]
    if content is not None:
        (tmp_path / "s.toml").write_bytes(content if isinstance(content, bytes) else content.encode())
    error = refused(tmp_path, "simulate", "--scenario", tmp_path / "s.toml", "-o", tmp_path / "deep" / "set")
    assert "s.toml" in error
    assert named in error


@pytest.mark.slow
def test_a_table_for_each_instrument_is_written_and_read(run, tmp_path):
    ran = run("simulate", "-o", tmp_path / "set", "--poses", "12", "--instrument", "plane", "--instrument", "range")
    assert (ran.code, ran.err) == (0, "")
    names = {file.name for file in (tmp_path / "set").iterdir()} - {".gtpin.json"}
    assert names == {"dataset.toml", "wire.csv", "bed.csv", "commands.csv"}
    kinds = [one["kind"] for one in tomllib.loads((tmp_path / "set" / "dataset.toml").read_text())["instrument"]]
    assert kinds == ["range", "plane"]
    assert len(Dataset.read(tmp_path / "set")) == 4 * 13 + 12  # a tenth of the stops twice, from four stations
    truth = json.loads((tmp_path / "set.truth.json").read_text())
    assert truth["effects"] == []
    assert {"wire.station[A].x", "wire.offset[D]", "bed.plane[low].height", "bed.target.z"} < set(truth["instruments"])
    assert "length[2a]" in truth["geometry"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # what a scenario holds constant is noticed
def test_a_scenario_gives_the_machine_its_effects_and_the_table_its_covariates(run, tmp_path):
    options = ("--scenario", BACKLASH, "--poses", "12", "--robot", "linear_delta", "--instrument", "socket", "--json")
    ran = run("simulate", "-o", tmp_path / "set", *options)
    assert json.loads(ran.out)["rows"] == 12
    assert [e["effect"] for e in json.loads((tmp_path / "set.truth.json").read_text())["effects"]] == ["backlash"]
    assert {"time", "approach1", "payload"} <= set(Dataset.read(tmp_path / "set").covariates)


def test_a_tracker_s_dataset_takes_the_place_of_one_of_other_instruments(run, tmp_path):
    assert run("simulate", "-o", tmp_path / "set", "--poses", "8", "--instrument", "tilt").code == 0
    assert run("simulate", "-o", tmp_path / "set", "--poses", "8").code == 0
    assert {file.name for file in tmp_path.iterdir()} - {".gtpin.json"} == {"set"}
    names = {file.name for file in (tmp_path / "set").iterdir()} - {".gtpin.json"}
    assert names == {"dataset.toml", "poses.csv", "commands.csv"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--instrument", "laser"], "no instrument is called 'laser'"),
        (["--instrument", "range", "--instrument", "range"], "the instrument range comes twice"),
        (["--instrument", "encoder", "--robot", "ur5"], "can be read by an encoder"),
        (["--instrument", "socket", "--robot", "asr_twodof"], "does not get to all of cup's sockets"),
    ],
)
def test_what_can_t_be_measured_is_one_line_and_no_files(tmp_path, options, what):
    assert what in refused(tmp_path, "simulate", "-o", tmp_path / "set", "--poses", "8", *options)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A dataset of a virtual five-bar, read by the encoder that the plant has, and its truth; not to be changed."""
    folder = tmp_path_factory.mktemp("five_bar")
    (folder / "five_bar.urdf").write_text(urdf())
    options = ("--robot", folder / "five_bar.urdf", "--instrument", "encoder", "--poses", "60")
    assert called("simulate", "-o", folder / "set", *options).code == 0
    return folder


@pytest.fixture
def five_bar(measured, tmp_path):
    """A copy of that folder, to be spoilt."""
    shutil.copytree(measured, tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the links of five_bar have no masses")
def test_an_encoder_s_data_go_the_whole_way(run, five_bar):
    cal = five_bar / "cal"
    assert run("calibrate", five_bar / "set", "-o", cal).code == 0
    told = json.loads((cal / "calibration.json").read_text())
    assert told["by_instrument"]["encoder"]["unit"] == "rad"
    assert told["by_instrument"]["encoder"]["rms_after"] < told["by_instrument"]["encoder"]["rms_before"] / 5.0
    truth = json.loads((five_bar / "set.truth.json").read_text())
    zero = next(p for p in told["parameters"] if p["name"] == "encoder.zero")
    assert abs(zero["value"] - truth["instruments"]["encoder.zero"]) < 4.0 * zero["sigma"]
    assert told["unobservable"][0]["words"]
    assert run("diagnose", five_bar / "set", "-o", five_bar / "out").code == 0
    assert json.loads((five_bar / "out" / "diagnosis.json").read_text())["verdict"] == "none"
    rows = Dataset.read(five_bar / "set")
    table = pd.DataFrame({"pose": rows.pose, "q1": rows.q[:, 0], "q2": rows.q[:, 1]}).drop_duplicates("pose")
    table.to_csv(five_bar / "again.csv", index=False)
    for model in (cal, five_bar / "out"):
        ran = run(
            "predict", model, five_bar / "again.csv", "-o", five_bar / "p.csv", "--instrument", "encoder", "--force"
        )
        assert ran.code == 0, ran.err
        found = pd.read_csv(five_bar / "p.csv", dtype={"pose": str}).set_index("pose")["reading"]
        off = rows.readings.columns["reading"] - found[rows.pose.astype(str)].to_numpy()
        assert np.sqrt((off**2).mean()) < 3e-5  # the encoder's noise is 2e-5 rad


@pytest.mark.parametrize(("joint", "what"), [("drive2", "driven by q2"), ("hand", "no joint 'hand'")])
@pytest.mark.parametrize("command", ["calibrate", "diagnose"])
def test_an_encoder_at_a_joint_that_can_t_be_read_is_one_line_and_no_files(five_bar, command, joint, what):
    toml = five_bar / "set" / "dataset.toml"
    toml.write_text(toml.read_text().replace('"elbow1"', f'"{joint}"'))
    error = refused(five_bar, command, five_bar / "set", "-o", five_bar / "out")
    assert what in error
    assert "elbow1, elbow2" in error
