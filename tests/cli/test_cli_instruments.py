"""``gtpin simulate --instrument``: a dataset of schema 2, and what is hidden of it beside it."""

import json
import tomllib
from pathlib import Path

import pytest

from gtpin.data import Dataset

BACKLASH = Path(__file__).parents[2] / "examples" / "scenarios" / "backlash.toml"


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


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--instrument", "laser"], "no instrument is called 'laser'"),
        (["--instrument", "range", "--instrument", "range"], "the instrument range comes twice"),
        (["--instrument", "encoder"], "can be read by an encoder"),
        (["--instrument", "socket", "--robot", "asr_twodof"], "does not get to all of cup's sockets"),
    ],
)
def test_what_can_t_be_measured_is_one_line_and_no_files(run, tmp_path, options, what):
    ran = run("simulate", "-o", tmp_path / "set", "--poses", "8", *options)
    assert ran.code == 2
    assert what in ran.err
    assert ran.err.count("\n") == 1
    assert not list(tmp_path.iterdir())
