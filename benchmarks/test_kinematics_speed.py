"""Closed postures a second: one by one, many in one call, SciPy's fsolve in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
import pytest

import gtpin
from gtpin.kinematics.kinematics import Kinematics

Floats = npt.NDArray[np.float64]
pytestmark = pytest.mark.benchmark(group="postures", min_rounds=5, timer=time.process_time)


def test_fsolve_on_the_closures(benchmark: Any, by_fsolve: Callable[[Floats], Floats], neighbours: Floats) -> None:
    benchmark(by_fsolve, neighbours)
    benchmark.extra_info["postures"] = len(neighbours)


def test_pinocchio_one_posture_after_the_other(
    benchmark: Any, robot: gtpin.Robot, rods: Kinematics, neighbours: Floats
) -> None:
    home = gtpin.home(robot)

    def walk() -> Floats:
        posture = home
        for q in neighbours:
            posture = posture.moved_to(q)
        return posture.T

    np.testing.assert_allclose(benchmark(walk), rods.forward(neighbours[-1:]).T[0], atol=1e-11)
    benchmark.extra_info["postures"] = len(neighbours)


def test_arrays_of_many_postures(benchmark: Any, rods: Kinematics) -> None:
    q = np.random.default_rng(0).uniform(-0.65, 0.70, (20_000, 3))
    poses = benchmark(rods.forward, q)
    assert poses.reached.all()
    benchmark.extra_info["postures"] = len(q)


@pytest.mark.parametrize("name", [name for name in gtpin.robot_names() if gtpin.load_robot(name).constraints])
def test_many_commands_that_a_shipped_robot_reaches(benchmark: Any, name: str) -> None:
    robot = gtpin.load_robot(name)
    kinematics = Kinematics(gtpin.Geometry.nominal(robot))
    drawn = np.random.default_rng(0).uniform(robot.lower, robot.upper, (5000, robot.n_actuators))
    q = drawn[kinematics.forward(drawn).reached][:2000]
    poses = benchmark(kinematics.forward, q)
    assert len(q) == 2000
    assert poses.reached.all()
    benchmark.extra_info["postures"] = len(q)


def test_one_evaluation_of_the_six_constraints_and_their_jacobian(benchmark: Any, robot: gtpin.Robot) -> None:
    configuration, data, models = gtpin.home(robot).configuration, robot.model.createData(), robot.constraint_models
    of_loops = pin.StdVec_ConstraintData()
    for model in models:
        of_loops.append(model.createData())

    def evaluate() -> Any:
        pin.computeJointJacobians(robot.model, data, configuration)
        for model, own in zip(models, of_loops, strict=True):
            model.calc(robot.model, data, own)
        return pin.getConstraintsJacobian(robot.model, data, models, of_loops)

    assert benchmark(evaluate).shape == (18, robot.model.nv)
    benchmark.extra_info["postures"] = 1
