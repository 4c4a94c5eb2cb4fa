"""Commands that can't be of the robot that they name are told apart from commands that are merely bad."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import gtpin
from gtpin.data import Commands, Dataset
from gtpin.errors import DatasetError, GtpinWarning
from gtpin.robot.command_ranges import check_commands, without_whole_turns
from gtpin.robot.library import load_robot

N = 60
NAMES = ("cart1", "cart2", "turn")
LOWER, UPPER, REVOLUTE = np.array([-0.6, -0.6, -0.8]), np.array([0.6, 0.6, 0.8]), np.array([False, False, True])


@dataclass(frozen=True)
class Drives:
    name: str = "the robot"
    sites: tuple[str, ...] = NAMES
    lower: np.ndarray = field(default_factory=LOWER.copy)
    upper: np.ndarray = field(default_factory=UPPER.copy)
    revolute: np.ndarray = field(default_factory=REVOLUTE.copy)


def measured():
    q = np.random.default_rng(1).uniform(LOWER, UPPER, (N, 3))
    return Dataset("r", [f"p{i}" for i in range(N)], q, np.zeros((N, 3)))


def check(dataset):
    check_commands(dataset, Drives())


def with_q(dataset, row, column, value):
    q = dataset.q.copy()
    q[row, column] = value
    return replace(dataset, q=q)


def test_plausible_commands_pass_without_a_word():
    check(measured())


@pytest.mark.parametrize("columns", [0, 2])
def test_another_number_of_actuators_is_refused(columns):
    data = measured()
    q = np.hstack([data.q, data.q])[:, : columns or 5]
    with pytest.raises(DatasetError, match="the robot has 3 actuators"):
        check(replace(data, q=q))


@pytest.mark.parametrize(("column", "factor", "unit"), [(0, 1000.0, "millimetres"), (2, 180 / np.pi, "degrees")])
def test_commands_in_another_unit_are_recognised(column, factor, unit):
    data = measured()
    with pytest.raises(DatasetError, match=f"looks like {unit}") as caught:
        check(with_q(data, slice(None), column, data.q[:, column] * factor))
    assert caught.value.column == f"q{column + 1}"


def test_a_command_far_outside_is_reported_with_its_row_and_without_a_guess():
    with pytest.raises(DatasetError, match="far outside the range of cart2") as caught:
        check(with_q(measured(), 7, 1, 1.9))
    assert (caught.value.row, caught.value.column) == (9, "q2")
    assert "looks" not in str(caught.value)


@pytest.mark.parametrize(("value", "far"), [(1.79, False), (1.81, True), (-1.79, False), (-1.81, True)])
def test_far_outside_means_more_than_the_range_is_wide(value, far):
    data = with_q(measured(), 7, 1, value)
    with pytest.raises(DatasetError) if far else pytest.warns(GtpinWarning):
        check(data)


def test_commands_a_little_outside_are_named_and_kept():
    with pytest.warns(GtpinWarning, match="a little outside.*: poses p3, p5$") as caught:
        check(with_q(measured(), [3, 5], 0, -0.61))
    assert len(caught) == 1


def test_commands_at_the_very_ends_of_the_range_are_inside_and_without_an_end_all_are():
    check(with_q(with_q(measured(), 0, 0, -0.6), 1, 0, 0.6))
    upper = np.array([0.6, 0.6, np.inf])
    check_commands(with_q(measured(), 0, 2, 1e3), Drives(lower=-upper, upper=upper))


def check_robot(robot: gtpin.Robot, q: np.ndarray) -> None:
    commands = Commands([str(i) for i in range(len(q))], q)
    check_commands(commands, robot)


@pytest.mark.parametrize("name", ["ur5", "kinova", "xarm7", "double_pendulum_continuous"])
def test_degrees_for_radians_are_named_by_the_joint(name: str) -> None:
    robot = load_robot(name)
    low, high = np.maximum(robot.lower, -2.0), np.minimum(robot.upper, 2.0)
    q = np.random.default_rng(1).uniform(low, high, (50, robot.n_actuators))
    check_robot(robot, q)
    with pytest.raises(DatasetError, match=r"looks? like degrees") as caught:
        check_robot(robot, np.rad2deg(q))
    assert "rad" in str(caught.value.hint)
    assert str(caught.value.column).startswith("q")


def test_a_joint_without_limits_may_turn_several_times_and_often() -> None:
    robot = load_robot("double_pendulum_continuous")
    rng = np.random.default_rng(2)
    for most in (15.0, 4000.0):  # a few turns, and hundreds of them, which no degrees of one turn are
        check_robot(robot, rng.uniform(-most, most, (50, 2)))


def test_commands_for_fewer_joints_say_how_to_name_those_that_were_commanded() -> None:
    with pytest.raises(DatasetError, match=r"7 commands a pose, but panda has 8 actuators.*actuators = \[...\]"):
        check_robot(load_robot("panda"), np.zeros((5, 7)))


def turned(q: np.ndarray, **limits: float) -> np.ndarray:
    low, high = limits.get("low", -1.9), limits.get("high", 1.9)
    rows = Commands([str(i) for i in range(len(q))], q[:, None])
    return without_whole_turns(rows, Drives("arm", ("j",), np.array([low]), np.array([high]), np.array([True]))).q[:, 0]


@pytest.mark.parametrize(("low", "high"), [(-1.9, 1.9), (-2.24, 2.24), (-3.1, 3.1), (-1.0, 3.0), (-4.0, 1.0)])
@pytest.mark.parametrize("first", [0.0, -360.0])
def test_commands_that_count_whole_turns_are_brought_into_the_range_and_it_is_told(low, high, first):
    right = np.random.default_rng(3).uniform(low, high, 50)
    counted = np.deg2rad((np.rad2deg(right) - first) % 360.0 + first)
    with pytest.warns(GtpinWarning, match=r"q1: a whole turn is taken off in \d+ of 50 rows, since j turns from"):
        assert turned(counted, low=low, high=high) == pytest.approx(right, abs=1e-12)


def test_commands_in_their_range_or_in_degrees_or_far_outside_stay_as_they_are():
    rng = np.random.default_rng(4)
    for q in (rng.uniform(-1.9, 1.9, 50), rng.uniform(-90, 90, 50), np.linspace(-1.9, 2.2, 50)):
        assert np.array_equal(turned(q), q)
    assert np.array_equal(turned(np.linspace(0.0, 6.2, 50), low=-7.0, high=7.0), np.linspace(0.0, 6.2, 50))
