"""The machines' examples do what they say."""

import importlib
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from closures import nominal
from scripts import load

import gtpin
from gtpin.errors import RobotError
from gtpin.robot.description import RobotDescription

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


@pytest.mark.slow
def test_tolerances_of_a_stewart_platform_spoil_what_its_jacobian_says() -> None:
    """Rms errors of 400 machines are known to 1 / sqrt(2 * 400 * 2) or 2.5 % at a pose; 4 of that."""
    example = load("stewart_tolerances")
    robot = gtpin.load_robot("stewart")
    q = example.workspace(robot)
    assert ((q >= robot.lower) & (q <= robot.upper)).all()
    drawn, predicted = example.accuracy(robot, q, machines=400)
    assert np.abs(predicted / drawn - 1.0).max() < 0.1
    assert len((EXAMPLES / "stewart_tolerances.py").read_text().splitlines()) < 60


def test_a_log_of_jugglebot_becomes_the_dataset_that_it_says(tmp_path: Path) -> None:
    example, closures = load("jugglebot/convert"), nominal("stewart_jugglebot")
    rng = np.random.default_rng(0)
    q = closures.in_range(rng, 60)
    made = closures.measured(q, rng)
    table = {f"leg_length_{i + 1}": q[:, i] / example.METRES_PER_REVOLUTION[i] for i in range(6)}
    table |= {f"position_{axis}": 1000.0 * made.position[:, i] for i, axis in enumerate("xyz")}
    table |= {f"orientation_{axis}": made.orientation[:, i] for i, axis in enumerate("wxyz")}
    table |= {"session": np.repeat(["day1", "day2"], 30)}
    example.dataset_of(pd.DataFrame(table)).write(tmp_path / "dataset")
    dataset = gtpin.Dataset.read(tmp_path / "dataset")
    np.testing.assert_allclose(dataset.q, q, rtol=1e-12)
    np.testing.assert_allclose(dataset.position, made.position, rtol=1e-12)
    assert dataset.robot == "stewart_jugglebot"
    assert dataset.instrument.position_sigma is None
    assert sorted(set(dataset.covariates["session"])) == ["day1", "day2"]


# The header and two rows of Project-DeepBlue-Juggling/Jugglebot, experimenting/platform_calibration/zOld/
# 108_calibration_poses.csv (MIT licence, Copyright (c) 2022 Jugleer).
UPSTREAM = """\
leg_length_1,leg_length_2,leg_length_3,leg_length_4,leg_length_5,leg_length_6,position_x,position_y,position_z,orientation_x,\
orientation_y,orientation_z,orientation_w
1.6767652,1.22339,1.2163502,1.8778893,1.9548622,1.8523405,5.68169641494751,-2.3655965328216553,751.5284423828125,\
0.07218229137154475,-0.013575722707873406,0.006013082209858942,0.9972809392557858
1.5469415,2.1703525,2.1010568,1.2076908,1.2095655,1.545841,8.406487464904785,3.568390130996704,751.1178588867188,\
-0.0919299520829081,0.03635264424291107,0.005202661216348001,0.9950880845655573
"""


def test_jugglebot_s_own_log_is_read(tmp_path: Path) -> None:
    """The first leg's 13.21144 rev/m: 1.6767652 turns are 0.126917671 m."""
    (tmp_path / "log.csv").write_text(UPSTREAM)
    load("jugglebot/convert").main([str(tmp_path / "log.csv"), str(tmp_path / "dataset")])
    dataset = gtpin.Dataset.read(tmp_path / "dataset")
    np.testing.assert_allclose(dataset.q[0, 0], 0.126917671, atol=1e-9)
    np.testing.assert_allclose(dataset.position[1], [0.008406487, 0.003568390, 0.751117859], atol=1e-9)
    assert dataset.orientation is not None
    np.testing.assert_allclose(dataset.orientation[0], [0.997280939, 0.072182291, -0.013575723, 0.006013082], atol=1e-8)


@pytest.mark.parametrize("spoilt", [UPSTREAM.replace("position_x", "x_mm"), UPSTREAM.replace("1.22339", "one"), ""])
def test_another_log_is_refused_in_one_line(tmp_path: Path, spoilt: str) -> None:
    (tmp_path / "log.csv").write_text(spoilt)
    with pytest.raises(SystemExit) as ended:
        load("jugglebot/convert").main([str(tmp_path / "log.csv"), str(tmp_path / "dataset")])
    assert str(ended.value.code).startswith(str(tmp_path / "log.csv"))
    assert "\n" not in str(ended.value.code)
    assert not (tmp_path / "dataset").exists()


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The writer of machines; the examples beside it can be imported."""
    monkeypatch.syspath_prepend(EXAMPLES / "machines")
    return importlib.import_module("machine_sketch")


@pytest.mark.usefixtures("written")
def test_urdfs_are_what_the_examples_write() -> None:
    names = ("tau", "gantry_tau_6dof", "stewart", "linear_delta", "stewart_jugglebot")
    for name in names:
        sketch = importlib.import_module(name).sketch()
        del sys.modules[name]
        assert sketch.urdf() == (ROOT / f"urdf/{name}.urdf").read_text(encoding="utf-8"), name
    assert {*names, "gantry_tau"} == set(gtpin.robot_names())


def test_dimensions_have_a_source_and_jugglebot_s_a_licence() -> None:
    for file in (ROOT / "urdf").glob("*.urdf"):
        head = file.read_text().split("<robot")[0]
        assert "ours" in head or "assumed" in head, file.name
    head = (ROOT / "urdf/stewart_jugglebot.urdf").read_text().split("<robot")[0]
    assert "github.com/Project-DeepBlue-Juggling/Jugglebot" in head
    assert "MIT" in head
    assert "Jugleer" in head


def test_a_sketch_that_can_not_be_is_one_line(written: ModuleType) -> None:
    rod = written.SketchRod("link1", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), carrier="cart9")
    carriers = [written.Carrier("cart1", (0, 0, 1), (1, 0, 0), (-1, 1))]
    with pytest.raises(RobotError, match="cart9"):
        written.Sketch("one", [rod], carriers, home=[0.0], T=(1, 0, 0)).urdf()
    with pytest.raises(RobotError, match="home has 0 commands for 1 actuators"):
        written.Sketch("two", [], carriers).urdf()


def test_an_actuator_s_scale_is_unknown_or_not_mentioned() -> None:
    urdf = gtpin.load_robot("stewart_jugglebot").description.xml
    assert all(a.scale_unknown for a in gtpin.load_robot("stewart_jugglebot").actuators)
    assert not any(a.scale_unknown for a in gtpin.load_robot("stewart").actuators)
    with pytest.raises(RobotError, match="scale"):
        RobotDescription.parse(urdf.replace('scale="unknown"', 'scale="perhaps"'))
