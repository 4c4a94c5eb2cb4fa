"""Public calls give the same bytes from eight threads as from one: data are a thread's own, results are not changed later."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gtpin

FIVE_BAR = Path(__file__).parents[2] / "examples/loops/five_bar.urdf"
ROBOTS = ("ur5", "gantry_tau", "linear_delta", str(FIVE_BAR))
THREADS, CALLS = 8, 48


@pytest.fixture(autouse=True)
def hurried_threads() -> Iterator[None]:
    """Threads take turns far more often than usual."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def numbers(found: Any) -> bytes:
    """The bytes of an array, of poses, or of a posture."""
    if isinstance(found, np.ndarray):
        return found.tobytes()
    return numbers(np.asarray(found.T)) + numbers(np.asarray(found.R))


def near_home(robot: gtpin.Robot) -> np.ndarray[Any, np.dtype[np.float64]]:
    q = np.random.default_rng(5).uniform(-0.1, 0.1, (12, 6, robot.n_actuators))
    return np.asarray(robot.home_q + q)


CALLS_OF_A_ROBOT: dict[str, Callable[[gtpin.Robot, Any], Any]] = {
    "forward of one": lambda robot, q: robot.forward(q[0]),
    "forward of many": lambda robot, q: robot.forward(q),
    "jacobian of one": lambda robot, q: robot.jacobian(q[0]),
    "jacobian of many": lambda robot, q: robot.jacobian(q),
    "inverse": lambda robot, q: robot.inverse(robot.forward(q[0]).T, start=q[0]),
    "velocity": lambda robot, q: robot.velocity(q, np.ones_like(q)),
    "acceleration": lambda robot, q: robot.acceleration(q, np.ones_like(q), np.ones_like(q)),
    "inverse dynamics": lambda robot, q: robot.inverse_dynamics(q, np.ones_like(q), np.ones_like(q)),
    "reflected inertia": lambda robot, q: robot.reflected_inertia(q),
    "constraint Jacobian": lambda robot, q: robot.forward(q[0]).constraint_jacobian,
    "static forces": lambda robot, q: gtpin.static_forces(robot.forward(q[0]), payload=1.0).actuators,
    "a moved posture": lambda robot, q: robot.forward(q[0]).moved_to(q[1]).jacobian,
}


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("call", CALLS_OF_A_ROBOT)
def test_a_robot_answers_eight_threads_as_one(name: str, call: str) -> None:
    ask = CALLS_OF_A_ROBOT[call]
    alone = gtpin.load_robot(name)
    q = near_home(alone)
    expected = [numbers(ask(alone, some)) for some in q]
    shared = gtpin.load_robot(name)  # nothing is known of it yet: the threads fill what is computed once
    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(lambda i: numbers(ask(shared, q[i % len(q)])), range(CALLS)))
    assert all(one == expected[i % len(q)] for i, one in enumerate(found))


@pytest.mark.parametrize("name", ROBOTS)
def test_a_calibrated_model_answers_eight_threads_as_one(name: str) -> None:
    robot = gtpin.load_robot(name)
    geometry = gtpin.Geometry.nominal(robot)
    moved = geometry.with_values(geometry.values + 0.3 * geometry.tolerance)
    q = near_home(robot)
    alone = gtpin.Model(moved)
    expected = [numbers(alone.predict(some)) for some in q]
    again = gtpin.Geometry.nominal(gtpin.load_robot(name)).with_values(moved.values)
    shared = gtpin.Model(again)
    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(lambda i: numbers(shared.predict(q[i % len(q)])), range(CALLS)))
    assert all(one == expected[i % len(q)] for i, one in enumerate(found))
