"""Newton's method on the loops: few steps, rounding at the end."""

import numpy as np
import pytest
from closures import Closures
from scipy.stats import qmc
from single_postures import Single

import gtpin
from gtpin.kinematics.copies import Copies
from gtpin.kinematics.first_guess import halton
from gtpin.kinematics.kinematics import Kinematics

Floats = np.ndarray


@pytest.mark.slow
def test_newton_from_a_neighbouring_posture_needs_at_most_four_steps(robot: gtpin.Robot, arrays: Kinematics) -> None:
    rng, loops = np.random.default_rng(1), arrays.loops
    q = rng.uniform(robot.lower + 0.05, robot.upper - 0.05, (1000, 3))
    poses, neighbour = arrays.forward(q), q + 0.05 * rng.uniform(-1.0, 1.0, q.shape)
    # From the neighbour's own coordinates, with nothing but the carts moved.
    assert poses.configuration is not None
    closing = loops.newton(
        loops.at(arrays.robot.with_commands(poses.configuration, neighbour), arrays.placed), arrays.placed
    )
    assert closing.closed.all()
    assert closing.steps.max() <= 4
    np.testing.assert_allclose(closing.here.X, arrays.forward(neighbour).configuration, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_a_solve_closes_the_loops_to_1e_14_of_their_size(
    gantry: Closures, robot: gtpin.Robot, at_home: gtpin.ClosedPosture
) -> None:
    rng = np.random.default_rng(2)
    for _ in range(300):
        q = rng.uniform(robot.lower, robot.upper)
        posture = at_home.moved_to(q)
        assert np.abs(Single(robot, q, posture.configuration).gaps).max() <= 1e-14 * robot.size
        gap = gantry.residual(q[None], posture.T[None], posture.R[None])
        assert np.abs(gap).max() <= 1e-14 * robot.size


def test_arrays_close_the_rods_to_1e_14_of_their_size(machine: Closures, closures: Kinematics) -> None:
    q = machine.commands(1000, seed=3)
    poses = closures.forward(q)
    size = np.abs(np.concatenate([machine.C(q).ravel(), poses.T.ravel(), machine.L(q).ravel()])).max()
    assert np.abs(machine.residual(q, poses.T, poses.R)).max() <= 1e-14 * max(1.0, size)


@pytest.mark.slow
def test_rotations_stay_orthogonal_over_long_paths(robot: gtpin.Robot, at_home: gtpin.ClosedPosture) -> None:
    posture = at_home
    for q in np.random.default_rng(4).uniform(robot.lower, robot.upper, (300, 3)):
        posture = posture.moved_to(q)
    np.testing.assert_allclose(posture.R @ posture.R.T, np.eye(3), rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", [name for name in gtpin.robot_names() if gtpin.load_robot(name).constraints])
def test_many_commands_near_home_take_few_postures_each_within_the_ranges_or_not(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, computed, joints = gtpin.load_robot(name), list[int](), Copies.joints

    def counting(self: Copies, X: Floats, placements: Floats) -> tuple[Floats, Floats]:
        computed.append(len(X))
        return joints(self, X, placements)

    q = robot.home_q + np.random.default_rng(0).uniform(-0.03, 0.03, (2000, robot.n_actuators))
    robot.forward(q + 1e-6)  # fits the first guess
    monkeypatch.setattr(Copies, "joints", counting)
    poses = robot.forward(q)
    assert sum(computed) <= 3.5 * len(q)
    near = robot.home_q + 0.9 * (q - robot.home_q)  # fewer than for a first guess: along paths
    np.testing.assert_allclose(robot.forward(near).T[:50], robot.forward(near[:50]).T, rtol=0, atol=1e-12)
    assert poses.reached.all()


def test_moving_nowhere_takes_no_step(at_home: gtpin.ClosedPosture, arrays: Kinematics) -> None:
    there = at_home.moved_to([0.1, -0.2, 0.3])
    assert arrays.loops.newton(
        arrays.loops.at(there.configuration[None], arrays.placed), arrays.placed
    ).steps.tolist() == [0]
    np.testing.assert_allclose(there.moved_to(there.q).configuration, there.configuration, rtol=0, atol=2e-14)


@pytest.mark.parametrize("coordinates", [1, 3, 6])
@pytest.mark.parametrize("count", [1, 2, 1001])
def test_the_sequence_is_scipys_to_the_last_bit(coordinates: int, count: int) -> None:
    assert np.array_equal(halton(coordinates, count), qmc.Halton(coordinates, scramble=False).random(count))
