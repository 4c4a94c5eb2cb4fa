"""The plant's own kinematics of six rods agrees with the URDF as Pinocchio closes it."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

import gtpin
from gtpin.bench.simulator.poses import VirtualPoses, exp, log
from gtpin.bench.simulator.rods import Rods, VirtualRodEnds, closed, each_solved
from gtpin.model.model_folder import calibrated_urdf
from gtpin.robot.description import RobotDescription

NAMES = gtpin.robot_names()


def commands(robot: gtpin.Robot, count: int, seed: int = 0) -> np.ndarray:
    """Commands up to a quarter of the ranges from home."""
    lower, upper = (np.where(np.isfinite(x), x, s * np.pi) for x, s in ((robot.lower, -1), (robot.upper, 1)))
    way = np.random.default_rng(seed).uniform(-0.25, 0.25, (count, robot.n_actuators)) * (upper - lower)
    return np.clip(robot.home_q + way, lower, upper)


@pytest.mark.parametrize("name", NAMES)
def test_so_they_are_for_a_geometry_drawn_from_its_tolerances(name: str) -> None:
    geometry = gtpin.Geometry.nominal(gtpin.load_robot(name))
    values = geometry.values + geometry.tolerance * np.random.default_rng(3).standard_normal(len(geometry.values))
    values = np.where([p.kind == "scale" for p in geometry.parameters], geometry.values, values)  # no place in a URDF
    drawn, q = geometry.with_values(values), commands(geometry.robot, 6, seed=1)
    written = RobotDescription.parse(calibrated_urdf(gtpin.Model(drawn)), name)
    start, found = gtpin.home(gtpin.Robot(written)), Rods(drawn).predict(q)
    for i, posture in enumerate(map(start.moved_to, q)):
        np.testing.assert_allclose(posture.T, found.T[i], rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(posture.R, found.R[i], rtol=0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_differences_of_the_poses(name: str) -> None:
    geometry = gtpin.Geometry.nominal(gtpin.load_robot(name))
    rods, q, step = Rods(geometry), commands(geometry.robot, 3), 1e-6
    poses = rods.predict(q)
    by_command, by_geometry = rods.command_jacobian(q, poses), rods.answer(q, poses, rods.changed(q))
    for i in range(geometry.robot.n_actuators):
        h = step * np.eye(geometry.robot.n_actuators)[i]
        slope = rods.predict(q + h).minus(rods.predict(q - h)) / (2.0 * step)
        np.testing.assert_allclose(by_command[:, :, i], slope, atol=1e-6 * max(1.0, np.abs(slope).max()))
    for i in range(0, len(geometry.values), 5):
        h = step * np.eye(len(geometry.values))[i]
        one, other = (Rods(geometry.with_values(geometry.values + s * h)).predict(q) for s in (1, -1))
        slope = one.minus(other) / (2.0 * step)
        np.testing.assert_allclose(by_geometry[:, :, i], slope, atol=1e-6 * max(1.0, np.abs(slope).max()))


def test_commands_out_of_reach_have_no_pose_and_do_not_disturb_the_others() -> None:
    robot = gtpin.load_robot("gantry_tau")
    rods = Rods(gtpin.Geometry.nominal(robot))
    q = np.vstack([commands(robot, 2), robot.home_q + np.array([3.0, -3.0, 3.0])])
    poses = rods.predict(q)
    assert poses.reached.tolist() == [True, True, False]
    assert np.abs(poses[:2].minus(rods.predict(q[:2]))).max() < 1e-14


def test_a_singular_platform_is_not_closed_and_a_regular_one_beside_it_is() -> None:
    rng = np.random.default_rng(0)
    P, C = rng.uniform(-0.3, 0.3, (6, 3)), rng.uniform(-1.0, 1.0, (6, 3))
    L = np.linalg.norm(P - C, axis=1)
    off = VirtualPoses(np.full((2, 3), 1e-3), np.stack([np.eye(3)] * 2))
    ends = VirtualRodEnds(np.stack([P, np.tile(P[0], (6, 1))]), np.stack([C, np.tile(C[0], (6, 1))]), np.stack([L, L]))
    poses, done = closed(off, ends, 1.0)
    assert done.tolist() == [True, False]
    assert np.abs(np.linalg.norm(poses.T[0] + P @ poses.R[0].T - C, axis=1) - L).max() < 1e-14
    solved = each_solved(np.stack([np.eye(2), np.ones((2, 2))]), np.ones((2, 2)))
    np.testing.assert_array_equal(np.isnan(solved), [[False, False], [True, True]])


def test_rotations_turn_as_they_should() -> None:
    quarter = exp([0.0, 0.0, np.pi / 2.0])
    np.testing.assert_allclose(quarter @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    for size in (1e-9, 0.99e-4, 1.01e-4, 1.0, 3.0):
        v = size * np.array([0.6, 0.0, -0.8])
        np.testing.assert_allclose(log(exp(v)), v, rtol=1e-7, atol=1e-15)
        np.testing.assert_allclose(exp(v) @ exp(-v), np.eye(3), atol=1e-15)
    slope = approx_fprime(np.zeros(3), lambda v: exp(v) @ [0.0, 0.0, 1.0], 1e-7)
    np.testing.assert_allclose(slope[0], [0.0, 1.0, 0.0], atol=1e-6)
