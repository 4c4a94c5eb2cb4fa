"""Passive motions that the loops leave free, joints that move nothing, and loop joints of other types: one line says so."""

import re
from pathlib import Path

import numpy as np
import pytest
from urdfs import joint, loop, own, urdf

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.errors import GtpinWarning, RobotError
from gtpin.robot.description import RobotDescription

FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"


def four_bar(end: str) -> str:
    """A four-bar (0.2, 0.3, 0.2 m on a base of 0.3 m) with a link d too many, whose anchor is at ``end`` on it."""
    return urdf(
        "under",
        joint("a", "base", "crank"),
        joint("b", "crank", "coupler", "0 0.2 0"),
        joint("c", "base", "rocker", "0.3 0 0"),
        joint("d", "rocker", "end", "0 0.2 0"),
        loop("coupler", "0.3 0 0", "end", end),
        own(["a"], "coupler"),
    )


def read(text: str, folder: Path) -> gtpin.Robot:
    file = folder / "robot.urdf"
    file.write_text(text, encoding="utf-8")
    return gtpin.load_robot(file)


@pytest.mark.slow
def test_a_free_motion_that_moves_the_tcp_is_refused_with_its_joints(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="1 passive motion of under can't be determined, and the TCP moves") as caught:
        read(four_bar("0.1 0 0"), tmp_path)
    weights = {name: float(weight) for name, weight in re.findall(r"(\w) \((\d\.\d\d)\)", str(caught.value))}
    assert "\n" not in str(caught.value)
    assert set(weights) <= set("bcd")
    assert np.linalg.norm(list(weights.values())) == pytest.approx(1.0, abs=0.02)  # a unit vector of three angles


@pytest.mark.slow
def test_a_spin_that_moves_nothing_is_named_and_left_as_it_is(tmp_path: Path) -> None:
    with pytest.warns(GtpinWarning, match=r"1 passive motion of under can't be determined, of d \(1.00\)"):
        robot = read(four_bar("0 0 0"), tmp_path)
    home = gtpin.home(robot)
    for q in (-0.7, 0.2, 0.8):
        posture = home.moved_to([q])
        # A parallelogram: the coupler does not turn.
        np.testing.assert_allclose(posture.T, [-0.2 * np.sin(q), 0.2 * np.cos(q), 0.0], atol=1e-12)
        np.testing.assert_allclose(posture.R, np.eye(3), atol=1e-12)
    made = simulate(robot, "under", poses=30, seed=1)
    found = gtpin.calibrate(made.dataset, robot)
    assert np.abs(found.model.predict(made.commands.q).minus(made.truth)[:, :3]).max() < 1e-4


def test_a_loop_joint_that_is_missing_is_missed(tmp_path: Path) -> None:
    text = FIVE_BAR.read_text(encoding="utf-8")
    start, end = text.index("<loop_joint"), text.index("</robot>")
    with pytest.warns(GtpinWarning, match="does not move with drive_right, elbow_right: .*<loop_joint>.*actuators"):
        robot = read(text[:start] + text[end:], tmp_path)
    assert robot.n_actuators == 4


def test_a_joint_that_moves_the_tcp_by_a_follower_is_not_missed() -> None:
    assert gtpin.load_robot("panda").n_actuators == 8  # the right finger, the TCP, follows the left one


@pytest.mark.parametrize("kind", ["revolute", "6d"])
def test_other_types_of_loop_joints_say_which_one_is_read(kind: str) -> None:
    text = FIVE_BAR.read_text(encoding="utf-8").replace('type="spherical"', f'type="{kind}"')
    with pytest.raises(RobotError, match=r'write type="spherical".*planar') as caught:
        RobotDescription.parse(text)
    assert f"of type {kind}" in str(caught.value)
