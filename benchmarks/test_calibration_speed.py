"""Calibrations: 61 poses with 60 parameters, 200 poses, 80,000 poses beside 20,000, and SciPy on the first of them."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator.simulate import Simulation, simulate
from gtpin.paper.geometry import nominal_geometry
from gtpin.paper.kinematics import kinematics_of

Floats = npt.NDArray[np.float64]
pytestmark = pytest.mark.benchmark(group="calibration", min_rounds=3, timer=time.process_time)


def _simulated(robot: gtpin.Robot, poses: int) -> Simulation:
    return simulate(robot, "gantry_tau", poses=poses, seed=1)


def test_61_poses_with_60_parameters(benchmark: Any, robot: gtpin.Robot) -> None:
    dataset = _simulated(robot, 61).dataset
    found = benchmark(lambda: gtpin.calibrate(dataset, robot, directions="rod", scale="rod"))
    assert len(found.names) == 60


def test_61_poses_with_60_parameters_by_least_squares(benchmark: Any, robot: gtpin.Robot) -> None:
    dataset = _simulated(robot, 61).dataset
    geometry = nominal_geometry(robot, directions="rod", scale="rod")
    R = Rotation.from_quat(dataset.orientation.copy(), scalar_first=True)  # type: ignore[union-attr]

    def residual(x: Floats) -> Floats:
        poses = kinematics_of(geometry.with_values(geometry.values + geometry.tolerance * x)).forward(dataset.q)
        turn = (R * Rotation.from_matrix(poses.R).inv()).as_rotvec()
        return np.concatenate([((dataset.position - poses.T) / 1.5e-5).ravel(), (turn / 5e-5).ravel(), x])

    found = benchmark.pedantic(lambda: least_squares(residual, np.zeros(60)), rounds=1)
    assert found.success


def test_200_poses(benchmark: Any, robot: gtpin.Robot) -> None:
    dataset = _simulated(robot, 200).dataset
    found = benchmark(lambda: gtpin.calibrate(dataset, robot))
    assert len(found.names) == 48


def test_many_poses_take_less_time_each_than_few(benchmark: Any, robot: gtpin.Robot) -> None:
    few, many = _simulated(robot, 20_000).dataset, _simulated(robot, 80_000).dataset
    start = time.process_time()
    gtpin.calibrate(few)
    once = time.process_time() - start
    start = time.process_time()
    found = benchmark.pedantic(lambda: gtpin.calibrate(many, robot), rounds=1)
    assert time.process_time() - start < once * len(many) / len(few)
    assert 0.97 < found.chi2_per_dof < 1.03
