"""Zeros, signs and couplings of commands are named, wherever the instrument stands; of correct data nothing is named."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from quick_first import quick_first
from serial_arm import measured_arm

import gtpin
from gtpin.calibration.checks.readings import CommandReading
from gtpin.calibration.checks.recognise import Interpretation, recognised
from gtpin.calibration.problem import measured_poses
from gtpin.errors import DatasetError

EVERYWHERE = pytest.mark.parametrize(
    ("frame", "target"), quick_first([("free", "tcp"), ("robot", "tcp"), ("free", "free")])
)


def named(data: gtpin.Dataset, *, failed: bool = False) -> Interpretation | None:
    nominal = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(data.robot_reference)))
    poses = nominal.kinematics.forward(data.q)
    return recognised(nominal, poses, measured_poses(data), data.instrument, failed=failed)


def shift(found: Interpretation | None, column: int) -> float:
    assert found is not None
    told = re.search(rf"q{column} looks shifted by [^ ]+ \(the drive's zero, ([^ ]+) degrees\)", found.looks)
    assert told is not None, found.looks
    return float(told[1])


def test_what_to_add_is_a_whole_quarter_of_a_turn_where_the_zero_is_within_its_tolerance_of_it() -> None:
    reading = CommandReading((), (), np.eye(3), zeros=(0, 1, 2))
    hint = reading.words(np.array([-1.5645, 0.35, -1.5645]), np.array([True, True, False])).hint
    assert hint == "add -1.5708 to q1 (-90 degrees), then add 0.35 to q2, then add -1.5645 to q3"


@EVERYWHERE
@pytest.mark.parametrize("degrees", [20.0, -55.0])
def test_a_zero_is_named_with_its_size(tmp_path: Path, frame: str, target: str, degrees: float) -> None:
    data = measured_arm(tmp_path, 1, frame=frame, target=target)
    q = data.q - np.deg2rad(degrees) * np.eye(6)[1]
    # Of twenty degrees a free frame and a free target take up so much that only a fit shows that something is wrong.
    found = named(replace(data, q=q), failed=abs(degrees) < 30.0)
    assert shift(found, 2) == pytest.approx(degrees, abs=1.0)


@pytest.mark.slow
@EVERYWHERE
@pytest.mark.parametrize("seed", [2, 3])
def test_two_zeros_are_named(tmp_path: Path, frame: str, target: str, seed: int) -> None:
    data = measured_arm(tmp_path, seed, frame=frame, target=target)
    found = named(replace(data, q=data.q - np.deg2rad([0, 90, -70, 0, 0, 0])))
    assert shift(found, 2) == pytest.approx(90.0, abs=1.0)
    assert shift(found, 3) == pytest.approx(-70.0, abs=1.0)


@EVERYWHERE
def test_a_zero_and_a_sign_are_named(tmp_path: Path, frame: str, target: str) -> None:
    data = measured_arm(tmp_path, 4, frame=frame, target=target)
    q = data.q - np.deg2rad([0, 90, 0, 0, 0, 0])
    found = named(replace(data, q=q * [1, 1, 1, 1, -1, 1]))
    assert shift(found, 2) == pytest.approx(90.0, abs=1.0)
    assert found is not None
    assert "q5 looks reversed" in found.looks


@pytest.mark.slow
@EVERYWHERE
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("degrees", [0.0, 40.0])
def test_a_joint_that_is_counted_from_the_horizontal_is_named(
    tmp_path: Path, frame: str, target: str, sign: float, degrees: float
) -> None:
    data = measured_arm(tmp_path, 5, frame=frame, target=target)
    q = data.q.copy()
    q[:, 2] -= sign * q[:, 1] + np.deg2rad(degrees)
    found = named(replace(data, q=q))
    assert found is not None
    assert f"the joint turns by q3 {'+' if sign > 0 else '-'} q2" in found.looks
    if degrees:
        assert shift(found, 3) == pytest.approx(degrees, abs=1.0)


def test_the_error_of_a_calibration_names_them(tmp_path: Path) -> None:
    data = measured_arm(tmp_path, 6)
    q = data.q.copy()
    q[:, 2] -= q[:, 1]
    with pytest.raises(DatasetError, match=r"the joint turns by q3 \+ q2; write q3 \+ q2 under q3$") as caught:
        gtpin.calibrate(replace(data, q=q))
    assert caught.value.column == "q3"


@pytest.mark.slow
def test_an_error_advises_nothing_that_is_set_already(tmp_path: Path) -> None:
    data = measured_arm(tmp_path, 6)
    order = np.random.default_rng(7).permutation(len(data))
    with pytest.raises(DatasetError) as caught:
        gtpin.calibrate(replace(data, position=data.position[order]))
    assert "free" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 121))
def test_of_correct_data_nothing_is_named_even_after_a_fit_has_failed(tmp_path: Path, seed: int) -> None:
    frame, target = ("free", "robot")[seed % 2], ("free", "tcp")[seed // 2 % 2]
    data = measured_arm(tmp_path, seed, frame=frame, target=target, orientations=seed % 3 == 0)
    assert named(data) is None
    assert named(data, failed=True) is None


def test_data_that_a_robot_with_one_drive_can_t_have_are_refused(tmp_path: Path) -> None:
    (tmp_path / "table.urdf").write_text(
        '<robot name="table"><link name="base"/><link name="arm"/><joint name="j" type="revolute"><parent link="base"/>'
        '<child link="arm"/><origin xyz="0.5 0 0.3"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/>'
        '</joint><link name="tool"/><joint name="t" type="fixed"><parent link="arm"/><child link="tool"/>'
        '<origin xyz="0.5 0 0.1"/></joint></robot>'
    )
    rng = np.random.default_rng(0)
    q, T = rng.uniform(-2.0, 2.0, (30, 1)), rng.uniform(-0.6, 0.6, (30, 3))
    data = gtpin.Dataset(str(tmp_path / "table.urdf"), [f"p{i}" for i in range(30)], q, T)
    with pytest.raises(DatasetError, match="can't be the robot's poses"):
        gtpin.calibrate(data)
