"""Commands of arms in degrees, or of the wrong number of joints, are named; joints without limits may turn often."""

from __future__ import annotations

import numpy as np
import pytest

import gtpin
from gtpin.data import Commands, check_commands
from gtpin.errors import DatasetError
from gtpin.robot.library import load_robot


def check(robot: gtpin.Robot, q: np.ndarray) -> None:
    commands = Commands([str(i) for i in range(len(q))], q)
    check_commands(commands, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute)


@pytest.mark.parametrize("name", ["ur5", "kinova", "xarm7", "double_pendulum_continuous"])
def test_degrees_for_radians_are_named_by_the_joint(name: str) -> None:
    robot = load_robot(name)
    low, high = np.maximum(robot.lower, -2.0), np.minimum(robot.upper, 2.0)
    q = np.random.default_rng(1).uniform(low, high, (50, robot.n_actuators))
    check(robot, q)
    with pytest.raises(DatasetError, match=r"looks? like degrees") as caught:
        check(robot, np.rad2deg(q))
    assert "rad" in str(caught.value.hint)
    assert str(caught.value.column).startswith("q")


def test_a_joint_without_limits_may_turn_several_times_and_often() -> None:
    robot = load_robot("double_pendulum_continuous")
    rng = np.random.default_rng(2)
    for most in (15.0, 4000.0):  # a few turns, and hundreds of them, which no degrees of one turn are
        check(robot, rng.uniform(-most, most, (50, 2)))


def test_commands_for_fewer_joints_say_how_to_name_those_that_were_commanded() -> None:
    with pytest.raises(
        DatasetError, match=r"7 columns of commands, but the robot has 8 actuators.*actuators = \[...\]"
    ):
        check(load_robot("panda"), np.zeros((5, 7)))
