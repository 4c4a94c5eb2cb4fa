"""Joints with <mimic> follow: they are not counted, and move with their masters in poses, derivatives and loads."""

import numpy as np
import pinocchio as pin
import pytest
from urdfs import joint, robot_of

import gtpin
from gtpin.errors import RobotError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.robot.resting import with_actuators

MASS = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def hinge(name: str, parent: str, child: str, inside: str = "", axis: str = "0 0 1", kind: str = "revolute") -> str:
    at = {"xyz": "0.4 0.1 0.2", "rpy": "0.1 0.2 0.3"}
    return joint(name, parent, child, axis=axis, kind=kind, limit=3.0, inside=inside, body=MASS, **at)


SERIES = (  # z follows y, which follows a, which comes after both in the document and in the alphabet before
    hinge("z", "base", "1", '<mimic joint="y" multiplier="-2" offset="0.1"/>', kind="continuous"),
    hinge("y", "1", "2", '<mimic joint="a" multiplier="0.5" offset="0.2"/>', "1 0 0"),
    hinge("a", "2", "3", axis="0 1 0"),
    hinge("s", "3", "4", '<mimic joint="a"/>', "1 1 0", kind="prismatic"),
    hinge("b", "4", "5"),
)


def by_hand(q: np.ndarray) -> pin.SE3:
    """Placement of link 5 at commands (a, b)."""
    y = 0.5 * q[0] + 0.2
    z = -2.0 * y + 0.1
    step = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0.4, 0.1, 0.2]))
    turns = ((z, (0, 0, 1)), (y, (1, 0, 0)), (q[0], (0, 1, 0)))
    found = pin.SE3.Identity()
    for angle, axis in turns:
        found = found * step * pin.SE3(pin.exp3(angle * np.array(axis, dtype=float)), np.zeros(3))
    found = found * step * pin.SE3(np.eye(3), q[0] * np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0))
    return found * step * pin.SE3(pin.exp3(q[1] * np.array([0.0, 0.0, 1.0])), np.zeros(3))


def test_followers_are_not_counted_and_move_with_the_master_at_the_end_of_their_series() -> None:
    robot = robot_of("m", *SERIES)
    assert robot.sites == ("a", "b")
    for q in np.random.default_rng(1).uniform(-2.0, 2.0, (10, 2)):
        posture, expected = gtpin.home(robot).moved_to(q), by_hand(q)
        np.testing.assert_allclose(posture.T, expected.translation, rtol=0, atol=1e-13)
        np.testing.assert_allclose(posture.R, expected.rotation, rtol=0, atol=1e-13)


def test_derivatives_by_commands_and_by_placements_hold_what_the_followers_do() -> None:
    robot = robot_of("m", *SERIES)
    geometry = gtpin.Geometry.nominal(robot)
    geometry = geometry.with_values(
        geometry.values + 1e-3 * np.random.default_rng(2).standard_normal(geometry.values.size)
    )
    here, q = Kinematics(geometry), np.array([[0.3, -0.8]])
    poses, step = here.forward(q), 1e-5

    def slopes(poses_at: object, x: np.ndarray) -> np.ndarray:
        moved = [
            (poses_at(x + step * e).minus(poses_at(x - step * e)) / (2.0 * step))[0]  # type: ignore[operator]
            for e in np.eye(len(x))
        ]
        return np.array(moved).T

    np.testing.assert_allclose(
        here.command_jacobian(q, poses)[0], slopes(lambda x: here.forward(x[None]), q[0]), rtol=0, atol=1e-8
    )
    by_values = slopes(lambda x: Kinematics(geometry.with_values(x)).forward(q), geometry.values)
    np.testing.assert_allclose(here.geometry_jacobian(q, poses)[0], by_values, rtol=0, atol=1e-8)


def test_the_drive_of_a_master_holds_its_followers_too() -> None:
    """Virtual work: the drive's torque is the slope of the potential energy by its command."""
    robot, q, step = robot_of("m", *SERIES), np.array([0.4, 0.2]), 1e-5

    def energy(q: np.ndarray) -> float:
        return float(pin.computePotentialEnergy(robot.model, robot.data, gtpin.home(robot).moved_to(q).configuration))

    slope = [(energy(q + step * e) - energy(q - step * e)) / (2.0 * step) for e in np.eye(2)]
    np.testing.assert_allclose(gtpin.static_forces(gtpin.home(robot).moved_to(q)).actuators, slope, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('<mimic joint="nobody"/>', "nobody"),
        ('<mimic joint="z"/>', "follows it"),
        ('<mimic joint="a" multiplier="fast"/>', "no number"),
        ('<mimic joint="a" offset="nan"/>', "no number"),
        ("<mimic/>", "no joint"),
    ],
)
def test_a_mimic_that_follows_nothing_is_refused(inside: str, said: str) -> None:
    with pytest.raises(RobotError, match=said):
        robot_of("m", hinge("z", "base", "1", inside), hinge("a", "1", "2"))


def test_a_mimic_of_a_fixed_joint_is_as_if_it_was_not_there() -> None:
    fixed = joint("f", "1", "2", kind="fixed", inside='<mimic joint="nobody"/>')
    assert robot_of("m", hinge("a", "base", "1"), fixed).sites == ("a",)


def test_a_follower_can_not_be_commanded() -> None:
    with pytest.raises(RobotError, match="follows a by <mimic>; name a"):
        with_actuators(robot_of("m", *SERIES).description, ["z"])


@pytest.mark.parametrize(("multiplier", "whole"), [("2", True), ("-1", True), ("0.5", False)])
def test_inverse_kinematics_take_off_whole_turns_only_where_the_followers_turn_so_too(
    multiplier: str, whole: bool
) -> None:
    geared = joint("f", "1", "2", "1 0 0", kind="continuous", inside=f'<mimic joint="a" multiplier="{multiplier}"/>')
    reach = joint("s", "2", "3", "0.5 0 0", "1 0 0", kind="prismatic", limit=0.3)
    robot = robot_of("m", joint("a", "base", "1", kind="continuous"), geared, reach)
    assert robot.endless.tolist() == [whole, False]
    q = np.column_stack([np.linspace(-6.0, 6.0, 25), np.full(25, 0.1)])
    poses = robot.forward(q)
    for start in (robot.home_q, q, q + np.array([2.0 * np.pi if whole else 0.02, 0.0])):
        found = robot.inverse(poses.T, start=start)
        np.testing.assert_allclose(robot.forward(found).T, poses.T, rtol=0, atol=1e-10)
        assert not whole or np.abs(found - start)[:, 0].max() <= np.pi
