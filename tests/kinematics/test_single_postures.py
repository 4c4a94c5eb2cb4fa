"""Batches are what Pinocchio says of one copy at one posture after the other: for every shipped robot, loop and arm."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from loaded_machines import drawn
from single_postures import Single, by_own, written

import gtpin
from gtpin.kinematics.kinematics import CHUNK, Kinematics
from gtpin.kinematics.rotations import log

Floats = np.ndarray
FIVE_BAR = str(Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf")
LOOPED = (*gtpin.robot_names(), FIVE_BAR)
NAMES = (*LOOPED, "ur5", "panda")


@pytest.fixture(scope="module", params=NAMES, ids=lambda name: Path(name).stem)
def robot(request: pytest.FixtureRequest) -> gtpin.Robot:
    return gtpin.load_robot(request.param)


looped = pytest.mark.parametrize("robot", LOOPED, indirect=True, ids=lambda name: Path(name).stem)


def commands(robot: gtpin.Robot, count: int, seed: int, share: float = 0.2) -> Floats:
    """Commands up to a share of the ranges from home; of endless joints, of one turn."""
    lower, upper = robot.ends
    way = np.random.default_rng(seed).uniform(-share, share, (count, robot.n_actuators)) * (upper - lower)
    return np.clip(robot.home_q + way, lower, upper)


def off(poses: gtpin.Poses, singles: list[Single]) -> float:
    """Largest difference of the poses from those of single postures, m and rad."""
    T, R = (np.array([getattr(one.tcp, part) for one in singles]) for part in ("translation", "rotation"))
    return float(np.abs(np.hstack([poses.T - T, log(poses.R @ np.swapaxes(R, 1, 2))])).max())


def relative(found: Floats, expected: Floats) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def test_poses_of_a_batch_are_those_of_single_postures(robot: gtpin.Robot) -> None:
    q = commands(robot, 6, seed=1)
    singles = [Single.at(robot, row) for row in q]
    assert off(Kinematics(gtpin.Geometry.nominal(robot)).forward(q), singles) <= 1e-12


def test_poses_of_a_geometry_are_those_of_single_postures_of_its_urdf(robot: gtpin.Robot) -> None:
    geometry = drawn(robot, 2)
    q, scale = commands(robot, 4, seed=3, share=0.15), geometry.scale
    other = written(geometry)
    start = Single.at(other, other.home_q)
    singles = [Single.at(other, row, start) for row in q * scale]  # no URDF holds a scale
    assert off(Kinematics(geometry).forward(q), singles) <= 2e-12


def test_derivatives_of_a_batch_are_those_of_single_postures(robot: gtpin.Robot) -> None:
    """By commands and by all parameters, from Pinocchio's constraint Jacobian and kinematic regressor of one copy."""
    scale = "actuator" if robot.rods else None
    geometry = gtpin.Geometry.nominal(robot, scale=scale)  # type: ignore[arg-type]
    here, q = Kinematics(geometry), commands(robot, 4, seed=4)
    poses = here.forward(q)
    by_commands, by_geometry = here.command_jacobian(q, poses), here.geometry_jacobian(q, poses)
    for i, row in enumerate(q):
        single = Single.at(robot, row)
        assert relative(by_commands[i], single.jacobian) <= 1e-9
        assert relative(by_geometry[i], single.by_parameters(geometry)) <= 1e-9


def test_derivatives_far_from_nominal_are_those_of_single_postures_of_the_geometry_s_urdf(robot: gtpin.Robot) -> None:
    """Some tolerances off, where an axis is no longer the nominal one."""
    scale = "actuator" if robot.rods else None
    nominal = gtpin.Geometry.nominal(robot, scale=scale)  # type: ignore[arg-type]
    far = 1.0 if robot.name == "stewart_jugglebot" else 3.0  # its loops do not close at home three tolerances off
    off = far * nominal.tolerance * np.random.default_rng(8).standard_normal(len(nominal.values))
    geometry = nominal.with_values(nominal.values + off)
    here, q = Kinematics(geometry), commands(robot, 3, seed=9, share=0.15)
    own = gtpin.Geometry.nominal(written(geometry), scale=scale)  # type: ignore[arg-type]
    poses, chain, start = here.forward(q), by_own(geometry, own), Single.at(own.robot, own.robot.home_q)
    by_commands, by_geometry = here.command_jacobian(q, poses), here.geometry_jacobian(q, poses)
    for i, row in enumerate(q * geometry.scale):
        single = Single.at(own.robot, row, start)
        np.testing.assert_allclose(poses.T[i], single.tcp.translation, rtol=0, atol=1e-11)
        assert relative(by_commands[i], single.jacobian * geometry.scale) <= 1e-9
        assert relative(by_geometry[i], single.by_parameters(own) @ chain) <= 1e-9


@pytest.mark.slow
@looped
def test_a_batch_s_configurations_close_the_loops_of_one_copy(robot: gtpin.Robot) -> None:
    """More postures than are closed at once: each row is at its own commands, and its loops are closed to rounding."""
    q = commands(robot, CHUNK + 76, seed=5)
    poses = Kinematics(gtpin.Geometry.nominal(robot)).forward(q)
    assert poses.reached.mean() > 0.9
    assert poses.configuration is not None
    for i in np.flatnonzero(poses.reached)[::29]:
        single = Single(robot, q[i], poses.configuration[i])
        assert np.abs(single.gaps).max() <= 1e-14 * robot.size
        np.testing.assert_array_equal(single.X, robot.with_commands(single.X, q[i]))
        np.testing.assert_allclose(poses.T[i], single.tcp.translation, rtol=0, atol=1e-14 * robot.size)
        np.testing.assert_allclose(poses.R[i], single.tcp.rotation, rtol=0, atol=1e-14)


@looped
def test_the_constraint_jacobian_of_a_posture_is_the_difference_of_its_gaps(robot: gtpin.Robot) -> None:
    posture = gtpin.home(robot).moved_to(commands(robot, 1, seed=6)[0])
    model, h = robot.model, 1e-5
    for v in set(range(model.nv)) - {follower.index_v for follower in robot.followers}:
        V = h * np.eye(model.nv)[v]
        for follower in robot.followers:
            V[follower.index_v] += follower.multiplier * V[follower.master_v]
        ends = (Single(robot, posture.q, pin.integrate(model, posture.configuration, s * V)).gaps for s in (1.0, -1.0))
        slope = np.subtract(*ends) / (2.0 * h)
        np.testing.assert_allclose(posture.constraint_jacobian[:, v], slope, rtol=0, atol=1e-8)


@looped
def test_a_posture_has_the_jacobians_of_pinocchio_s_own_data(robot: gtpin.Robot) -> None:
    posture = gtpin.home(robot).moved_to(commands(robot, 1, seed=7)[0])
    single = Single(robot, posture.q, posture.configuration)
    np.testing.assert_allclose(posture.constraint_jacobian, single.constraint_jacobian, rtol=0, atol=1e-14)
    np.testing.assert_allclose(posture.tcp_jacobian, single.tcp_jacobian, rtol=0, atol=1e-14)
    assert relative(posture.jacobian, single.jacobian) <= 1e-12
