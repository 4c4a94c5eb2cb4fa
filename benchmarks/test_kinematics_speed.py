"""Closed postures a second: Pinocchio one by one, arrays of many, SciPy's fsolve in the same run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import gtpin
from gtpin.kinematics.rod_kinematics import RodKinematics

Floats = npt.NDArray[np.float64]
pytestmark = pytest.mark.benchmark(group="postures", min_rounds=5)


def test_fsolve_on_the_closures(benchmark: Any, by_fsolve: Callable[[Floats], Floats], neighbours: Floats) -> None:
    benchmark(by_fsolve, neighbours)
    benchmark.extra_info["postures"] = len(neighbours)


def test_pinocchio_one_posture_after_the_other(benchmark: Any, robot: gtpin.Robot, neighbours: Floats) -> None:
    home = gtpin.home(robot)

    def walk() -> int:
        posture, most = home, 0
        for q in neighbours:
            posture = posture.moved_to(q)
            most = max(most, posture.steps)
        return most

    assert benchmark(walk) <= 4
    benchmark.extra_info["postures"] = len(neighbours)


def test_arrays_of_many_postures(benchmark: Any, rods: RodKinematics) -> None:
    q = np.random.default_rng(0).uniform(-0.65, 0.70, (20_000, 3))
    poses = benchmark(rods.forward, q)
    assert poses.reached.all()
    benchmark.extra_info["postures"] = len(q)


def test_one_evaluation_of_the_six_constraints_and_their_jacobian(benchmark: Any, robot: gtpin.Robot) -> None:
    from gtpin.kinematics import newton

    configuration = gtpin.home(robot).configuration

    def evaluate() -> None:
        newton.pin.computeJointJacobians(robot.model, robot.data, configuration)
        newton.constraint_error(robot)
        newton.constraint_jacobian(robot)

    benchmark(evaluate)
    benchmark.extra_info["postures"] = 1
