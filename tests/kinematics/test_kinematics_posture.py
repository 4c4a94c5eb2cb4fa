"""A closed posture can't be spoilt, robots travel between processes, rotations are rotations."""

import copy
import pickle

import numpy as np
import pytest
from closures import Closures
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays as array_of
from loaded_machines import load
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.rotations import exp, from_quaternions, left_jacobian, log, to_quaternions

READ_ONLY = (
    "configuration",
    "q",
    "T",
    "R",
    "constraint_jacobian",
    "tcp_jacobian",
    "jacobian",
    "passive_response",
    "passive_inverse",
)


@pytest.mark.parametrize("name", READ_ONLY)
def test_arrays_of_a_closed_posture_are_read_only(at_home: gtpin.ClosedPosture, name: str) -> None:
    array = getattr(at_home.moved_to([0.1, 0.1, 0.1]), name)
    with pytest.raises(ValueError, match="read-only"):
        array[...] = 0.0


def test_the_caller_may_do_with_the_tcp_what_he_likes(at_home: gtpin.ClosedPosture) -> None:
    posture = at_home.moved_to([0.1, 0.1, 0.1])
    before = posture.T.copy()
    posture.tcp.translation = np.zeros(3)
    np.testing.assert_array_equal(posture.T, before)
    np.testing.assert_array_equal(posture.tcp.translation, before)


def test_a_posture_stays_what_it_was_when_the_robot_moves_on(robot: gtpin.Robot, at_home: gtpin.ClosedPosture) -> None:
    q = np.array([0.3, -0.2, 0.5])
    alone = at_home.moved_to(q)
    expected = (alone.T, alone.R, alone.jacobian, gtpin.static_forces(alone).rods)
    posture = at_home.moved_to(q)
    at_home.moved_to([-0.6, 0.6, -0.6])  # the same scratch memory
    found = (posture.T, posture.R, posture.jacobian, gtpin.static_forces(posture).rods)
    for one, other in zip(expected, found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_changing_the_commands_afterwards_changes_nothing(at_home: gtpin.ClosedPosture) -> None:
    q = np.array([0.1, 0.2, 0.3])
    posture = at_home.moved_to(q)
    q[:] = 9.0
    np.testing.assert_array_equal(posture.q, [0.1, 0.2, 0.3])


def test_a_robot_pickles_and_behaves_the_same(machine: Closures, loaded: gtpin.Robot) -> None:
    again = pickle.loads(pickle.dumps(loaded))
    assert again.sites == loaded.sites
    assert again.rod_sites == loaded.rod_sites
    assert again.tcp_frame == loaded.tcp_frame
    assert dict(again.tolerance) == dict(loaded.tolerance)
    q = machine.commands(10, seed=1)
    for row in q:
        one, other = gtpin.home(loaded).moved_to(row), gtpin.home(again).moved_to(row)
        np.testing.assert_array_equal(one.T, other.T)
        np.testing.assert_array_equal(one.jacobian, other.jacobian)


def test_models_pickle_and_copy_with_what_they_have_computed(machine: Closures, loaded: gtpin.Robot) -> None:
    model = gtpin.Model(gtpin.Geometry.nominal(loaded))
    q = machine.commands(10, seed=2)
    before = model.predict(q)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(model)).predict(q).T, before.T)
    np.testing.assert_array_equal(copy.deepcopy(model).predict(q).T, before.T)


def test_a_robot_with_another_tcp_pickles_with_it(gantry: Closures) -> None:
    robot = gtpin.Robot(load(gantry).description, tcp="platform")
    assert pickle.loads(pickle.dumps(robot)).tcp_frame == "platform"


def test_poses_seen_from_another_frame_are_moved_there(machine: Closures, closures: Kinematics) -> None:
    R, T = Rotation.from_rotvec([0.3, -0.2, 1.0]).as_matrix(), np.array([5.0, -1.0, 0.5])
    poses = closures.forward(machine.commands(5, seed=3))
    moved = poses.moved(T, R)
    for i in range(5):
        np.testing.assert_allclose(moved.T[i], R @ poses.T[i] + T, rtol=0, atol=1e-14)
        np.testing.assert_allclose(moved.R[i], R @ poses.R[i], rtol=0, atol=1e-15)


vectors = array_of(float, (4, 3), elements=st.floats(-1.8, 1.8))
scales = st.sampled_from([1.0, 1e-3, 1e-4, 1e-5, 1e-9, 0.0])


@settings(max_examples=60, deadline=None)
@given(vectors, scales)
def test_exp_is_scipys_and_log_undoes_it(vector: np.ndarray, scale: float) -> None:
    v = scale * vector
    R = exp(v)
    np.testing.assert_allclose(R, Rotation.from_rotvec(v).as_matrix(), rtol=0, atol=2e-15)
    near = np.linalg.norm(v, axis=1) < 3.0
    np.testing.assert_allclose(log(R)[near], v[near], rtol=0, atol=1e-14)


@settings(max_examples=60, deadline=None)
@given(vectors, scales)
def test_quaternions_come_back_of_one_sign_along_the_array(vector: np.ndarray, scale: float) -> None:
    R = exp(scale * vector)
    wxyz = to_quaternions(R)
    np.testing.assert_allclose(from_quaternions(wxyz), R, rtol=0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(wxyz, axis=1), 1.0, rtol=0, atol=1e-15)
    assert (wxyz @ wxyz[0] >= 0.0).all()
    half_angle = np.linalg.norm(scale * vector, axis=1) / 2.0
    np.testing.assert_allclose(np.abs(wxyz[:, 0]), np.abs(np.cos(half_angle)), rtol=0, atol=1e-14)


@settings(max_examples=60, deadline=None)
@given(array_of(float, 3, elements=st.floats(-1.5, 1.5)), scales)
def test_left_jacobian_is_the_derivative_of_exp(vector: np.ndarray, scale: float) -> None:
    v, h = scale * vector, 1e-5
    columns = [
        log(exp((v + h * e)[None]) @ np.swapaxes(exp((v - h * e)[None]), 1, 2))[0] / (2.0 * h) for e in np.eye(3)
    ]
    np.testing.assert_allclose(left_jacobian(v), np.column_stack(columns), rtol=0, atol=1e-9)
