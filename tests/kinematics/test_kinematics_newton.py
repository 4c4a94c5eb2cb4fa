"""Newton's method on the loops: few steps, rounding at the end."""

import numpy as np
import pytest
from closures import Closures
from scipy.stats import qmc

import gtpin
from gtpin.kinematics import newton
from gtpin.kinematics.closures import halton
from gtpin.kinematics.rod_kinematics import RodKinematics


@pytest.mark.slow
def test_newton_from_a_neighbouring_posture_needs_at_most_four_steps(
    robot: gtpin.Robot, at_home: gtpin.ClosedPosture
) -> None:
    rng = np.random.default_rng(1)
    steps = []
    for _ in range(1000):
        q = rng.uniform(robot.lower + 0.05, robot.upper - 0.05)
        posture = at_home.moved_to(q)
        neighbour = q + 0.05 * rng.uniform(-1.0, 1.0, 3)
        # From the neighbour's own coordinates, with nothing but the carts moved.
        closing = newton.close(robot, robot.with_commands(posture.configuration, neighbour))
        assert closing.closed
        steps += [closing.steps, posture.moved_to(neighbour).steps]
    assert max(steps) <= 4


@pytest.mark.slow
def test_a_solve_closes_the_loops_to_1e_14_of_their_size(
    gantry: Closures, robot: gtpin.Robot, at_home: gtpin.ClosedPosture
) -> None:
    rng = np.random.default_rng(2)
    for _ in range(300):
        q = rng.uniform(robot.lower, robot.upper)
        posture = at_home.moved_to(q)
        posture.refresh()
        assert np.abs(newton.constraint_error(robot)).max() <= 1e-14 * robot.size
        gap = gantry.residual(q[None], posture.T[None], posture.R[None])
        assert np.abs(gap).max() <= 1e-14 * robot.size


def test_arrays_close_the_rods_to_1e_14_of_their_size(machine: Closures, closures: RodKinematics) -> None:
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


def test_moving_nowhere_takes_no_step(at_home: gtpin.ClosedPosture) -> None:
    there = at_home.moved_to([0.1, -0.2, 0.3])
    assert there.moved_to(there.q).steps == 0


@pytest.mark.parametrize("coordinates", [1, 3, 6])
@pytest.mark.parametrize("count", [1, 2, 1001])
def test_the_sequence_is_scipys_to_the_last_bit(coordinates: int, count: int) -> None:
    assert np.array_equal(halton(coordinates, count), qmc.Halton(coordinates, scramble=False).random(count))
