"""Singularities: rank, condition number and direction of the closures' and the actuators' Jacobians."""

import numpy as np
import pytest
from moving_robots import MAKERS, made, motion

from gtpin.errors import ModelError
from gtpin.kinematics.posture import ClosedPosture
from gtpin.kinematics.robot import Robot
from gtpin.kinematics.singularities import singularities
from gtpin.robot.resting import put

Floats = np.ndarray


def five_bar(spread: float) -> ClosedPosture:
    """The five-bar with its far links in one line but for an angle: both drives turned outwards to the base line, less this."""
    robot = made("five_bar")
    X, angle = robot.neutral.copy(), np.pi - spread
    apart = 0.2 - 2.0 * 0.3 * np.cos(angle)  # of the elbows, which are 0.3 m from their drives
    coordinates = {"drive_left": angle - 2.2, "elbow_left": np.arccos(apart / 0.8) - angle + 1.3758}
    coordinates |= {"drive_right": -coordinates["drive_left"], "elbow_right": -coordinates["elbow_left"]}
    for name, value in coordinates.items():
        joint = robot.model.getJointId(name)
        put(X, int(robot.model.idx_qs[joint]), value, robot.model.nqs[joint] == 2)
    q = np.array([coordinates[actuator.joint] for actuator in robot.actuators])
    posture = ClosedPosture(robot, q, X)
    gap = posture.constraint_data[0].extract().constraint_position_error
    np.testing.assert_allclose(gap, 0.0, atol=1e-7)  # the URDF has angles of eight digits
    return posture


def test_a_wrist_whose_axes_are_parallel_loses_a_motion() -> None:
    ur5 = made("ur5")
    found = singularities(ur5, [0.1, -1.0, 1.2, 0.3, 0.0, -0.4])
    assert found.actuators.rank == 5
    assert found.actuators.condition == np.inf
    np.testing.assert_allclose(
        ur5.jacobian([0.1, -1.0, 1.2, 0.3, 0.0, -0.4]) @ found.actuators.direction, 0.0, atol=1e-12
    )
    assert "shoulder_pan_joint" not in found.actuators.weights(least=1e-9)
    assert found.closures.condition == 1.0
    assert found.closures.rank == 0
    regular = singularities(ur5, [0.1, -1.0, 1.2, 0.3, 0.8, -0.4])
    assert regular.actuators.rank == 6
    assert regular.actuators.condition < 100.0


def test_a_five_bar_moves_with_locked_drives_where_its_far_links_are_in_line() -> None:
    robot = made("five_bar")
    near = [float(singularities(robot, five_bar(spread)).closures.condition) for spread in (0.1, 0.05, 0.025)]
    np.testing.assert_allclose(np.divide(near[1:], near[:-1]), 2.0, rtol=0.05)  # twice as near, twice as large
    found = singularities(robot, five_bar(0.0)).closures
    assert found.sizes[1] < 1e-7 * found.sizes[0]
    assert found.rank == 1
    assert found.condition == np.inf
    assert found.joints == ("elbow_left", "elbow_right")
    np.testing.assert_allclose(np.abs(found.direction), np.sqrt(0.5), atol=1e-6)


@pytest.mark.parametrize("name", MAKERS)
def test_sizes_are_those_of_the_postures_jacobians_in_which_an_angle_is_an_arc(name: str) -> None:
    robot = made(name)
    q = np.array([motion(robot, seed)[0] for seed in (1, 2)])
    many, one = singularities(robot, q, length=0.3), singularities(robot, q[1], length=0.3)
    posture = robot.forward(q[1])
    arcs = np.where(robot.revolute, 0.3, 1.0)
    J = posture.jacobian / arcs
    J[3:] *= 0.3
    np.testing.assert_allclose(one.actuators.sizes, np.linalg.svd(J)[1][: robot.n_actuators], rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(J @ one.actuators.direction), one.actuators.sizes[-1], rtol=0, atol=1e-12)
    assert one.actuators.joints == tuple(actuator.joint for actuator in robot.actuators)
    for ours, rows in ((one.closures, many.closures), (one.actuators, many.actuators)):
        np.testing.assert_allclose(ours.sizes, rows.sizes[1], rtol=0, atol=1e-11)
        np.testing.assert_allclose(ours.condition, rows.condition[1], rtol=1e-9)
        assert ours.rank == rows.rank[1]
        assert ours.weights() == pytest.approx(rows.weights(1), abs=1e-6)
    if robot.constraints:
        assert one.closures.rank == robot.rank
        sizes = np.linalg.svd(scaled(robot, posture, 0.3))[1][: robot.rank]
        np.testing.assert_allclose(one.closures.sizes, sizes, rtol=0, atol=1e-12)
        assert singularities(robot, posture).closures.rank == robot.rank


def scaled(robot: Robot, posture: ClosedPosture, arc: float) -> Floats:
    """The closures' Jacobian; joints that turn are those whose velocity turns some joint's frame."""
    D = posture.constraint_jacobian[:, robot.passive].copy()
    turns = np.linalg.norm(posture.data.J[3:, robot.passive], axis=0) > 0.5
    D[:, turns] /= arc
    return D


def test_rows_that_are_not_reached_are_not_numbers() -> None:
    robot = made("gantry_tau")
    found = singularities(robot, [robot.home_q, [9.0, -9.0, 9.0]])
    assert found.closures.rank.tolist() == [18, -1]
    assert found.actuators.rank.tolist() == [3, -1]
    assert np.isnan(found.closures.condition[1])
    assert np.isnan(found.actuators.direction[1]).all()
    assert {"platform_pose.x", "link2a_yaw"} <= set(found.closures.joints)


def test_what_is_no_length_and_no_posture_of_this_robot_is_refused() -> None:
    robot = made("gantry_tau")
    with pytest.raises(ModelError, match="length"):
        singularities(robot, robot.home_q, length=0.0)
    with pytest.raises(ModelError, match="another robot"):
        singularities(robot, made("tau").forward(made("tau").home_q))
    with pytest.raises(ModelError, match="commands of shape"):
        singularities(robot, [[0.0, 0.0]])
