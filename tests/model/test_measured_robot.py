"""The robot that a dataset names has its actuators and its TCP; parts that it lacks are named by their key."""

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.data import Driver
from gtpin.errors import DatasetError, ModelError
from gtpin.model.measured_robot import robot_of
from gtpin.robot.library import load_robot

SEVEN = tuple(f"panda_joint{i}" for i in range(1, 8))


@pytest.fixture(scope="module")
def dataset() -> gtpin.Dataset:
    made = simulate(load_robot("panda", tcp="panda_hand", actuators=SEVEN), "panda", poses=60, seed=5).dataset
    return replace(made, actuators=SEVEN, tcp="panda_hand", covariates={"tilt": np.linspace(0.0, 1.0, len(made))})


def test_a_dataset_of_some_joints_is_written_read_and_calibrated(dataset: gtpin.Dataset, tmp_path: Path) -> None:
    dataset.write(tmp_path / "panda")
    found = gtpin.calibrate(gtpin.Dataset.read(tmp_path / "panda"))
    assert found.model.robot.sites == SEVEN
    assert found.model.robot.tcp_frame == "panda_hand"
    assert 0.7 < found.chi2_per_dof < 1.3


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"tcp": "hand"}, "tcp"),
        ({"actuators": (*SEVEN[:-1], "panda_joint9")}, "actuators"),
        ({"actuators": (*SEVEN[:-1], "panda_finger_joint2")}, "actuators"),
        ({"robot": "pandah"}, "robot"),
        ({"drivers": (Driver("tilt", "elbow", "rx", 1e-3),)}, "driver.0.site"),
        ({"drivers": (Driver("tilt", "panda_link3", "q", 1e-3),)}, "driver.0.motion"),
    ],
)
def test_what_the_robot_lacks_is_named_by_its_key(dataset: gtpin.Dataset, changes: dict[str, object], key: str) -> None:
    with pytest.raises(DatasetError) as caught:
        robot_of(replace(dataset, **changes))  # type: ignore[arg-type]
    assert caught.value.column == key
    assert caught.value.hint
    assert "\n" not in str(caught.value)


def test_drivers_may_act_at_links_joints_the_platform_and_the_frame(dataset: gtpin.Dataset) -> None:
    places = ("panda_link3", "panda_joint2", "platform", "frame")
    drivers = (*(Driver("tilt", site, "rx", 1e-3) for site in places), Driver("tilt", "panda_joint2", "q", 1e-3))
    assert robot_of(replace(dataset, drivers=drivers)).n_actuators == 7


def test_a_robot_whose_tcp_is_named_does_not_ask_for_it(dataset: gtpin.Dataset) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert robot_of(dataset).tcp_frame == "panda_hand"
        assert robot_of(replace(dataset, tcp=None)).tcp_frame != "panda_hand"
    (told,) = (str(one.message) for one in caught if "names no TCP" in str(one.message))
    assert told.endswith("name it (tcp, --tcp)")


@pytest.mark.parametrize("name", ["calibration.json", "report.html"])
def test_a_file_of_a_result_is_no_model_and_its_folder_is_named(tmp_path: Path, name: str) -> None:
    gtpin.write_model(gtpin.read_model("gantry_tau"), tmp_path / "model")
    (tmp_path / name).write_text("{}")
    with pytest.raises(ModelError, match=f"give the folder: {re.escape(str(tmp_path))}$"):
        gtpin.read_model(tmp_path / name)
    assert gtpin.read_model(tmp_path / "model" / "model.json").robot.name == "gantry_tau"
