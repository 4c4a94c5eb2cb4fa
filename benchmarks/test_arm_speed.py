"""An arm of six joints, 200 poses: calibration, SciPy's least squares with numerical derivatives on the same, diagnosis."""

from __future__ import annotations

import time
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import Dataset
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.plant.case import make_case

Floats = npt.NDArray[np.float64]
pytestmark = pytest.mark.benchmark(group="arm", timer=time.process_time)


@pytest.fixture(scope="module")
def measured() -> Dataset:
    effects = [("joint_compliance", "shoulder_lift_joint")]
    return make_case(1, robot="ur5", effects=effects, energy=1000.0, poses=200).dataset


def test_an_arm_s_200_poses(benchmark: Any, measured: Dataset) -> None:
    warnings.simplefilter("ignore")
    found = benchmark.pedantic(gtpin.calibrate, args=(measured,), rounds=5, warmup_rounds=1)
    assert len(found.names) == 42


def test_an_arm_s_200_poses_by_least_squares(benchmark: Any, measured: Dataset) -> None:
    geometry = gtpin.Geometry.nominal(gtpin.load_robot("ur5"))
    R = Rotation.from_quat(measured.orientation.copy(), scalar_first=True)  # type: ignore[union-attr]

    def residual(x: Floats) -> Floats:
        poses = ChainKinematics(geometry.with_values(geometry.values + geometry.tolerance * x)).forward(measured.q)
        turn = (R * Rotation.from_matrix(poses.R).inv()).as_rotvec()
        return np.concatenate([((measured.position - poses.T) / 1.5e-5).ravel(), (turn / 5e-5).ravel(), x])

    found = benchmark.pedantic(lambda: least_squares(residual, np.zeros(len(geometry.names))), rounds=1)
    assert found.success


def test_an_arm_s_diagnosis_of_200_poses(benchmark: Any, measured: Dataset) -> None:
    warnings.simplefilter("ignore")
    found = benchmark.pedantic(gtpin.diagnose, args=(measured,), rounds=2)
    assert found.causes
