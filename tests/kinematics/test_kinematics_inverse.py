"""Inverse kinematics: the commands that bring the TCP where it is wanted."""

import numpy as np
import pytest
from closures import Closures

import gtpin
from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.rotations import exp, log


@pytest.mark.slow
def test_commands_come_back_from_positions_over_the_whole_range(
    machine: Closures, loaded: gtpin.Robot, closures: Kinematics
) -> None:
    q = machine.commands(500, seed=1)
    poses = closures.forward(q)
    wanted = (poses.T, poses.R) if len(machine.q) == 6 else (poses.T, None)
    found, there = gtpin.commands_for(closures, *wanted)
    np.testing.assert_allclose(there.T, poses.T, rtol=0, atol=1e-11)
    np.testing.assert_allclose(closures.forward(found).T, poses.T, rtol=0, atol=1e-11)
    unique = machine.name != "rotary_tau"  # its arms bring the TCP to many a point in two ways
    assert not unique or np.abs(found - q).max() <= 1e-8
    for i in range(30):
        one = gtpin.reach(gtpin.home(loaded), poses.T[i], None if wanted[1] is None else poses.R[i])
        assert not unique or np.abs(one.q - q[i]).max() <= 1e-8
        np.testing.assert_allclose(one.T, poses.T[i], rtol=0, atol=1e-11)


@pytest.mark.parametrize("machine", ["stewart"], indirect=True)
def test_a_stewart_platform_reaches_positions_with_rotations(
    machine: Closures, loaded: gtpin.Robot, closures: Kinematics
) -> None:
    rng = np.random.default_rng(2)
    T = machine.T + rng.uniform(-0.05, 0.05, (200, 3))
    R = exp(rng.uniform(-0.1, 0.1, (200, 3))) @ machine.R
    q, there = gtpin.commands_for(closures, T, R)
    # In closed form: a leg is as long as its ends are apart.
    d = T[:, None] + machine.P @ np.swapaxes(R, 1, 2) - machine.C(machine.q[None])
    np.testing.assert_allclose(machine.L(q), np.linalg.norm(d, axis=2), rtol=0, atol=1e-11)
    assert np.abs(log(there.R @ np.swapaxes(R, 1, 2))).max() <= 1e-11
    posture = gtpin.reach(gtpin.home(loaded), T[0], R[0])
    np.testing.assert_allclose(posture.q, q[0], rtol=0, atol=1e-10)


@pytest.mark.parametrize("machine", ["linear_delta"], indirect=True)
def test_a_linear_delta_has_its_commands_in_closed_form(machine: Closures, closures: Kinematics) -> None:
    T = machine.T + np.random.default_rng(3).uniform(-0.08, 0.08, (200, 3))
    q, _ = gtpin.commands_for(closures, T)
    base, end = machine.C(np.zeros((1, 3)))[0, ::2], T[:, None] + machine.P[::2]
    aside = np.linalg.norm((end - base)[..., :2], axis=2)
    height = end[..., 2] - base[:, 2] + np.sqrt(0.55**2 - aside**2)
    np.testing.assert_allclose(q, height, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_positions_out_of_reach_raise_or_are_nan_and_the_others_are_right(
    arrays: Kinematics, at_home: gtpin.ClosedPosture
) -> None:
    near, far = at_home.T + np.array([[0.1, 0.05, -0.05], [0.0, 3.0, 0.0]])
    with pytest.raises(UnreachableError, match="gantry_tau") as caught:
        gtpin.reach(at_home, far)
    assert "\n" not in str(caught.value)
    q, poses = gtpin.commands_for(arrays, np.array([near, far, [np.nan, 0, 0], near]))
    assert np.isnan(q[1:3]).all()
    np.testing.assert_array_equal(poses.reached, [True, False, False, True])
    np.testing.assert_allclose(poses.T[[0, 3]], [near, near], rtol=0, atol=1e-11)
    np.testing.assert_allclose(gtpin.reach(at_home, near).q, q[0], rtol=0, atol=1e-9)


def test_a_rotation_that_three_carts_can_not_give_is_out_of_reach(
    at_home: gtpin.ClosedPosture, arrays: Kinematics
) -> None:
    R = exp(np.array([0.0, 0.0, 0.3])) @ at_home.R
    with pytest.raises(UnreachableError, match="rotation"):
        gtpin.reach(at_home, at_home.T, R)
    q, _ = gtpin.commands_for(arrays, at_home.T[None], R[None])
    assert np.isnan(q).all()


def test_wanted_poses_that_are_none_are_refused(at_home: gtpin.ClosedPosture, arrays: Kinematics) -> None:
    with pytest.raises(ModelError):
        gtpin.reach(at_home, [0.0, 0.0])
    with pytest.raises(ModelError):
        gtpin.reach(at_home, at_home.T, np.eye(4))
    with pytest.raises(UnreachableError):
        gtpin.reach(at_home, [np.nan, 0.0, 0.0])
    with pytest.raises(ModelError):
        gtpin.commands_for(arrays, np.zeros((4, 2)))
    with pytest.raises(ModelError):
        gtpin.commands_for(arrays, np.zeros((4, 3)), np.eye(3))


def test_nothing_wanted_is_nothing_found(arrays: Kinematics) -> None:
    q, poses = gtpin.commands_for(arrays, np.zeros((0, 3)))
    assert q.shape == (0, 3)
    assert len(poses) == 0


def test_start_is_only_where_the_search_begins(arrays: Kinematics, robot: gtpin.Robot) -> None:
    rng = np.random.default_rng(4)
    q = rng.uniform(robot.lower, robot.upper, (100, 3))
    start = np.clip(q + rng.uniform(-0.1, 0.1, q.shape), robot.lower, robot.upper)
    kept = start.copy()
    found, _ = gtpin.commands_for(arrays, arrays.forward(q).T, start=start)
    np.testing.assert_allclose(found, q, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(start, kept)
