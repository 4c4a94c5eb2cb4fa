"""The assembly mode of home is kept along any path within the range."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from closures import Closures
from loaded_machines import closed_by_hand
from quick_first import quick_first
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.errors import AssemblyModeError
from gtpin.kinematics.closing import Closed, LoopClosure
from gtpin.kinematics.kinematics import MANY, Kinematics
from gtpin.kinematics.placed import PlacedParts
from gtpin.kinematics.rotations import log
from gtpin.robot.description import RobotDescription

Floats = np.ndarray


def within_the_range(robot: gtpin.Robot, count: int, seed: int) -> Floats:
    return np.random.default_rng(seed).uniform(robot.lower, robot.upper, (count, robot.n_actuators))


def orientation(machine: Closures, q: Floats, T: Floats, R: Floats) -> Floats:
    """(N,) sign of the closures' determinant by the pose, which changes where modes meet."""
    RP = machine.P @ np.swapaxes(R, 1, 2)
    d = T[:, None] + RP - machine.C(q)
    return np.sign(np.linalg.det(np.concatenate([d, np.cross(RP, d)], axis=2)))


@pytest.mark.slow
def test_paths_between_random_postures_keep_the_mode(
    gantry: Closures, robot: gtpin.Robot, at_home: gtpin.ClosedPosture
) -> None:
    q = within_the_range(robot, 1500, seed=2)
    T, R = gantry.follow(q, stride=0.01)
    posture = at_home
    for row, position, rotation in zip(q, T, R, strict=True):
        posture = posture.moved_to(row)  # from the posture before, anywhere in the range
        assert np.abs(posture.T - position).max() <= 1e-12
        assert np.abs(posture.R - rotation).max() <= 1e-12


@pytest.fixture(scope="module")
def other_modes(gantry: Closures) -> list[tuple[Floats, Floats]]:
    """The closures' real solutions at q = 0 other than home, found by Newton's method from random starts."""
    rng, q = np.random.default_rng(4), np.zeros((400, 3))
    start = Rotation.from_rotvec(rng.uniform(-np.pi, np.pi, (400, 3))).as_matrix()
    with np.errstate(all="ignore"):
        T, R = gantry.close(q, gantry.T + rng.uniform(-4.0, 4.0, (400, 3)), start, steps=60)
    closed = np.abs(gantry.residual(q, T, R)).max(axis=1) <= 1e-11
    found: list[tuple[Floats, Floats]] = []
    for pose in zip(T[closed], R[closed], strict=True):
        known = [(gantry.T, gantry.R), *found]
        if len(found) < 5 and all(sum(np.abs(a - b).max() for a, b in zip(pose, k, strict=True)) > 1e-6 for k in known):
            found.append(pose)
    return found


def test_the_closures_have_five_other_solutions_which_are_never_returned(
    other_modes: list[tuple[Floats, Floats]], robot: gtpin.Robot, arrays: Kinematics, at_home: gtpin.ClosedPosture
) -> None:
    assert len(other_modes) == 5
    q = within_the_range(robot, 300, seed=5)
    away = arrays.forward(q)
    # There and back again, by both ways of computing.
    returned = [at_home.moved_to(row).moved_to(np.zeros(3)).T for row in q[:50]]
    returned += list(arrays.forward(np.zeros((1, 3)), start=None).T)
    for T, _ in other_modes:
        assert min(np.linalg.norm(back - T) for back in returned) > 1e-3
    assert np.abs(np.array(returned) - at_home.T).max() <= 1e-12
    assert away.reached.all()


def test_the_whole_range_is_reached_on_one_side_of_the_singularities(
    gantry: Closures, robot: gtpin.Robot, arrays: Kinematics
) -> None:
    q = within_the_range(robot, 5000, seed=6)
    poses = arrays.forward(q)
    assert poses.reached.all()
    at_home = orientation(gantry, np.zeros((1, 3)), gantry.T[None], gantry.R[None])
    assert (orientation(gantry, q, poses.T, poses.R) == at_home).all()


def test_the_plate_turns_by_less_than_0_6_degrees_over_the_range(
    gantry: Closures, robot: gtpin.Robot, arrays: Kinematics
) -> None:
    turn = np.linalg.norm(log(arrays.forward(within_the_range(robot, 2000, seed=7)).R @ gantry.R.T), axis=1)
    assert 0.1 < np.degrees(turn).max() < 0.6


def test_outside_the_range_a_pose_is_on_homes_side_of_the_singularities_or_there_is_none(
    machine: Closures, closures: Kinematics
) -> None:
    rng = np.random.default_rng(8)
    q = machine.q + rng.uniform(-1.0, 1.0, (2000, len(machine.q))) * 3.0 * machine.spread
    poses = closures.forward(q)
    there = poses.reached
    assert 0.005 < there.mean() < 0.995  # some of each, or nothing is tested
    home = orientation(machine, machine.q[None], machine.T[None], machine.R[None])
    assert (orientation(machine, q[there], poses.T[there], poses.R[there]) == home).all()
    assert np.abs(machine.residual(q[there], poses.T[there], poses.R[there])).max() <= 1e-13
    assert np.isnan(poses.T[~there]).all()
    assert np.isnan(poses.R[~there]).all()


def test_starting_from_neighbouring_poses_ends_at_the_same_poses_as_starting_from_home(
    robot: gtpin.Robot, arrays: Kinematics
) -> None:
    rng = np.random.default_rng(9)
    nominal = gtpin.Geometry.nominal(robot)
    q = within_the_range(robot, 300, seed=10)
    known = arrays.forward(q)
    for _ in range(5):
        moved = Kinematics(nominal.with_values(nominal.values + nominal.tolerance * rng.standard_normal(48)))
        difference = moved.forward(q, known).minus(moved.forward(q))
        assert np.abs(difference).max() <= 1e-12


def test_a_robot_whose_urdf_names_another_home_takes_that_mode(
    other_modes: list[tuple[Floats, Floats]], gantry: Closures
) -> None:
    T, R = other_modes[0]
    old = gantry.urdf[gantry.urdf.index("<home") : gantry.urdf.index("<gravity")]
    rotvec = Rotation.from_matrix(R).as_rotvec()
    new = f'<home q="0 0 0" tcp_xyz="{T[0]} {T[1]} {T[2]}" tcp_rotvec="{rotvec[0]} {rotvec[1]} {rotvec[2]}"/>'
    other = gtpin.Robot(RobotDescription.parse(gantry.urdf.replace(old, new)))
    np.testing.assert_allclose(gtpin.home(other).T, T, rtol=0, atol=1e-11)
    poses = Kinematics(gtpin.Geometry.nominal(other)).forward(np.zeros((1, 3)))
    np.testing.assert_allclose(poses.T[0], T, rtol=0, atol=1e-11)


@pytest.mark.parametrize("link", ["coupler", "rocker"])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("q", [0.0, 0.7, 2.5])
def test_the_home_that_a_urdf_names_selects_the_assembly_of_a_planar_loop(
    four_bar: gtpin.Robot, link: str, side: float, q: float
) -> None:
    at, turn = closed_by_hand(q, side)[link]
    named = f'<platform link="{link}"/><home q="{q}" tcp_xyz="{at[0]} {at[1]} 0" tcp_rotvec="0 0 {turn}"/>'
    robot = gtpin.Robot(RobotDescription.parse(four_bar.description.xml.replace('<platform link="rocker"/>', named)))
    home = gtpin.home(robot)
    np.testing.assert_allclose(home.T[:2], at, atol=1e-12)
    np.testing.assert_allclose(log(home.R)[2], turn, atol=1e-9)
    moved = home.moved_to([q + 0.3])
    at, turn = closed_by_hand(q + 0.3, side)[link]
    np.testing.assert_allclose(log(moved.R)[2], turn, atol=1e-9)


@pytest.mark.parametrize("turn", [0.4, -2.0])
def test_a_home_where_the_loop_does_not_close_is_refused(four_bar: gtpin.Robot, turn: float) -> None:
    named = f'<platform link="coupler"/><home q="0" tcp_xyz="0.2 0 0" tcp_rotvec="0 0 {turn}"/>'
    robot = gtpin.Robot(RobotDescription.parse(four_bar.description.xml.replace('<platform link="rocker"/>', named)))
    with pytest.raises(AssemblyModeError, match="rad from the home"):
        gtpin.home(robot)
    with pytest.raises(AssemblyModeError, match="rad from the home"):
        gtpin.Model(gtpin.Geometry.nominal(robot)).predict([[0.0]])


@pytest.mark.parametrize("name", quick_first(gtpin.robot_names(), 2))
def test_many_commands_at_once_are_reached_as_along_paths_from_home(name: str) -> None:
    """Many are closed from a fitted guess, few by paths: over the whole ranges, where some lie beyond singularities."""
    robot = gtpin.load_robot(name)
    q = np.random.default_rng(7).uniform(robot.lower, robot.upper, (MANY, robot.n_actuators))
    at_once = Kinematics(gtpin.Geometry.nominal(robot)).forward(q)
    other = Kinematics(gtpin.Geometry.nominal(gtpin.load_robot(name)))
    for rows in np.split(np.arange(MANY), 4):
        few, some = other.forward(q[rows]), at_once[rows]
        assert np.array_equal(few.reached, some.reached)
        assert np.abs(few.T - some.T)[few.reached].max() <= 1e-12
        assert np.abs(few.R - some.R)[few.reached].max() <= 2e-12


class NeverClosed(LoopClosure):
    """Closures whose Newton's method ends in no closed posture."""

    def newton(self, *arguments: Any, **options: Any) -> Closed:
        found = super().newton(*arguments, **options)
        return replace(found, closed=np.zeros_like(found.closed))


def test_a_path_that_is_followed_again_ends_where_its_loops_are_nearly_closed(four_bar: gtpin.Robot) -> None:
    """A path whose first step ends at home, and whose shorter ones meet a point beyond reach on the way."""
    loops, own = NeverClosed(four_bar), Kinematics(gtpin.Geometry.nominal(four_bar))
    start, q, beyond = own.at_home, four_bar.home_q, 0.05

    def path(s: Floats, rows: Floats) -> tuple[Floats, PlacedParts]:
        anchors = np.repeat(own.placed.anchors[None], len(s), axis=0)
        anchors[:, 0] += 10.0 * ((s > beyond) & (s < 1.0))[:, None]  # m: the links are shorter
        return np.tile(q, (len(s), 1)), replace(own.placed, anchors=anchors)

    last, reached, done = loops.follow(start, path, 1e6)
    assert not reached.any()
    assert done[0] <= beyond
    assert loops.gap(loops.at(last.X, own.placed))[0] < 1e-9
