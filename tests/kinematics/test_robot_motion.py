"""Velocities, Jacobians and accelerations of every frame against differences of poses, and Pinocchio's own."""

import numpy as np
import pinocchio as pin
import pytest
from moving_robots import FIRST, MAKERS, POINTS, SECOND, made, motion

from gtpin.errors import ClosureError, ModelError
from gtpin.kinematics.frames import Moving
from gtpin.kinematics.robot import Robot
from gtpin.kinematics.rotations import log

Floats = np.ndarray
LOOPED = [name for name in MAKERS if name not in ("ur5", "series")]


@pytest.fixture(params=MAKERS)
def moved(request: pytest.FixtureRequest) -> Robot:
    return made(request.param)


@pytest.mark.slow
def test_velocities_and_accelerations_of_all_frames_are_the_differences_of_poses_along_a_curve(moved: Robot) -> None:
    (q, v, a), step = motion(moved), 2e-3
    t = step * POINTS
    curve = q + np.outer(t, v) + 0.5 * np.outer(t * t, a)
    for frame in (None, *moved.links):
        poses = moved.forward(curve, frame)
        turned = log(poses.R @ poses.R[4].T)
        first, second = (np.concatenate([w @ poses.T, w @ turned]) for w in (FIRST / step, SECOND / step**2))
        velocity, acceleration = moved.velocity(q, v, frame), moved.acceleration(q, v, a, frame)
        size = 1.0 + max(np.abs(velocity).max(), np.abs(acceleration).max())
        np.testing.assert_allclose(velocity, first, rtol=0, atol=1e-9 * size)
        np.testing.assert_allclose(acceleration, second, rtol=0, atol=1e-7 * size)


def test_an_acceleration_is_the_jacobian_times_a_and_a_drift_that_v_and_its_opposite_share(moved: Robot) -> None:
    q, v, a = motion(moved, 2)
    for frame in (None, moved.links[1], moved.links[-1]):
        J, drift = moved.jacobian(q, frame), moved.acceleration(q, v, 0.0 * a, frame)
        np.testing.assert_allclose(J @ v, moved.velocity(q, v, frame), rtol=0, atol=1e-12)
        np.testing.assert_allclose(moved.acceleration(q, v, a, frame), J @ a + drift, rtol=0, atol=1e-11)
        np.testing.assert_allclose(moved.acceleration(q, -v, 0.0 * a, frame), drift, rtol=0, atol=1e-11)


def test_one_command_gives_the_row_of_many(moved: Robot) -> None:
    rows = [motion(moved, seed) for seed in (3, 4, 5)]
    q, v, a = (np.array(part) for part in zip(*rows, strict=True))
    for frame in (None, moved.links[-1]):
        many = moved.forward(q, frame)
        for i in range(3):
            one = moved.forward(q[i], frame)
            np.testing.assert_allclose(one.T, many.T[i], rtol=0, atol=1e-12)
            np.testing.assert_allclose(one.R, many.R[i], rtol=0, atol=1e-12)
            np.testing.assert_allclose(moved.jacobian(q[i], frame), moved.jacobian(q, frame)[i], rtol=0, atol=1e-11)
            np.testing.assert_allclose(moved.velocity(q[i], v[i], frame), moved.velocity(q, v, frame)[i], atol=1e-11)
            one, rows = moved.acceleration(q[i], v[i], a[i], frame), moved.acceleration(q, v, a, frame)
            np.testing.assert_allclose(one, rows[i], rtol=0, atol=1e-10)
    tiled = moved.velocity(q, np.tile(v[0], (3, 1)))
    np.testing.assert_allclose(moved.velocity(q, v[0]), tiled, rtol=0, atol=1e-13)


def test_the_frame_of_the_tcp_is_the_tcp(moved: Robot) -> None:
    q, v, _ = motion(moved, 6)
    link = moved.tcp_frame
    np.testing.assert_allclose(moved.forward(q, link).T, moved.forward(q).T, rtol=0, atol=1e-14)
    np.testing.assert_allclose(moved.jacobian(q[None], link)[0], moved.jacobian(q), rtol=0, atol=1e-11)
    np.testing.assert_allclose(moved.jacobian(q[None])[0], moved.jacobian(q), rtol=0, atol=1e-11)
    posture = moved.forward(q, moved.links[1]).moved_to(q + 0.01 * v)
    np.testing.assert_allclose(posture.T, moved.forward(q + 0.01 * v, moved.links[1]).T, rtol=0, atol=1e-12)


def test_of_a_tree_it_is_pinocchios_own_answer() -> None:
    ur5 = made("ur5")
    q, v, a = motion(ur5, 7)
    model, data = ur5.model, ur5.model.createData()
    pin.forwardKinematics(model, data, q, v, a)
    for frame in ur5.links:
        at = model.getFrameId(frame, pin.FrameType.BODY)
        for ours, theirs in (
            (ur5.velocity(q, v, frame), pin.getFrameVelocity(model, data, at, pin.LOCAL_WORLD_ALIGNED)),
            (
                ur5.acceleration(q, v, a, frame),
                pin.getFrameClassicalAcceleration(model, data, at, pin.LOCAL_WORLD_ALIGNED),
            ),
        ):
            np.testing.assert_allclose(ours, theirs.vector, rtol=0, atol=1e-13)
        J = pin.computeFrameJacobian(model, data, q, at, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(ur5.jacobian(q, frame), J, rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", LOOPED)
def test_loops_stay_closed_in_pinocchios_velocities_and_accelerations(name: str) -> None:
    robot = made(name)
    q, v, a = motion(robot, 8)
    posture = robot.forward(q)
    moving = Moving(robot, posture.configuration[None])
    V, A = moving.velocities(v[None])[0], moving.accelerations(v[None], a[None])[0]
    np.testing.assert_allclose(V[robot.driven], v, rtol=0, atol=1e-14)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, posture.configuration, V, A)
    for constraint in robot.constraints:
        its = constraint.createData()
        constraint.calc(robot.model, data, its)
        np.testing.assert_allclose(its.constraint_velocity_error, 0.0, atol=1e-11)
        np.testing.assert_allclose(its.constraint_acceleration_error, 0.0, atol=1e-10 * (1.0 + np.abs(A).max()))


@pytest.mark.parametrize("name", LOOPED)
def test_pinocchios_constraint_jacobian_of_ones_own_call_is_the_postures(name: str) -> None:
    robot = made(name)
    posture = robot.forward(motion(robot, 9)[0])
    datas = pin.StdVec_ConstraintData()
    for constraint in robot.constraint_models:
        datas.append(constraint.createData())
        constraint.calc(robot.model, posture.data, datas[-1])
    J = pin.getConstraintsJacobian(robot.model, posture.data, robot.constraint_models, datas)
    own = pin.getConstraintsJacobian(robot.model, posture.data, robot.constraint_models, posture.constraint_data)
    np.testing.assert_array_equal(own, J)
    if not robot.followers and all(plane is None for plane in robot.planes):
        np.testing.assert_allclose(posture.constraint_jacobian, J, rtol=0, atol=1e-12)
    np.testing.assert_allclose(posture.constraint_jacobian, robot.closing(robot.folded(J)), rtol=0, atol=1e-12)
    # A passive motion, taken back by the response to the gaps that it opens, leaves the TCP where it was.
    opened = posture.passive_response @ posture.constraint_jacobian[:, robot.passive]
    np.testing.assert_allclose(opened, -posture.tcp_jacobian[:, robot.passive], rtol=0, atol=1e-10)


def test_a_link_that_spins_freely_disturbs_no_other_and_has_the_smallest_velocity() -> None:
    robot = made("spinning")
    (q, v, a), step = motion(robot, 10), 2e-3
    t = step * POINTS
    curve = q + np.outer(t, v) + 0.5 * np.outer(t * t, a)
    for frame in (None, "rocker"):
        np.testing.assert_allclose(
            robot.velocity(q, v, frame)[:3], FIRST / step @ robot.forward(curve, frame).T, atol=1e-9
        )
        second = SECOND / step**2 @ robot.forward(curve, frame).T
        np.testing.assert_allclose(robot.acceleration(q, v, a, frame)[:3], second, rtol=0, atol=1e-7)
    posture = robot.forward(q)
    V = Moving(robot, posture.configuration[None]).velocities(v[None])[0]
    D = posture.constraint_jacobian
    smallest = -np.linalg.pinv(D[:, robot.passive]) @ D[:, robot.driven] @ v
    np.testing.assert_allclose(V[robot.passive], smallest, rtol=0, atol=1e-12)
    assert np.isfinite(robot.inverse_dynamics(q, v, a)).all()
    with pytest.raises(ModelError, match="leave motions free"):
        robot.forces(q, v, a)


def test_a_frame_that_does_not_exist_and_rates_that_do_not_fit_are_refused() -> None:
    ur5, gantry = made("ur5"), made("gantry_tau")
    for call in (ur5.forward, ur5.jacobian, lambda q, frame: ur5.velocity(q, np.zeros(6), frame)):
        with pytest.raises(ModelError, match="no link 'nose'; links are "):
            call(np.zeros(6), frame="nose")
    for wrong in (np.zeros(5), np.full(6, np.nan), np.zeros((2, 6))):
        with pytest.raises(ModelError):
            ur5.velocity(np.zeros(6), wrong)
    with pytest.raises(ModelError, match="a pose of forearm_link"):
        ur5.inverse(ur5.forward(np.zeros(6), "forearm_link"))
    with pytest.raises(ModelError, match="forces that don't fit 1 commands"):
        ur5.inverse_dynamics(np.zeros(6), np.zeros(6), np.zeros(6), force=[1.0, 2.0])
    with pytest.raises(ClosureError, match="row 1"):
        gantry.velocity([gantry.home_q, [9.0, -9.0, 9.0]], np.zeros(3))
