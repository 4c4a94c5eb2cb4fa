"""An arm of six joints: calibration and diagnosis, SciPy's least squares with numerical derivatives, FIGAROH's regressor.

FIGAROH is compared with where it is installed: ``pip install figaroh``.
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator.case import make_case
from gtpin.data import Dataset
from gtpin.kinematics.kinematics import Kinematics

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import telescope_arm

Floats = npt.NDArray[np.float64]
pytestmark = pytest.mark.benchmark(group="arm", timer=time.process_time)


def _measured(poses: int) -> Dataset:
    effects = [("joint_compliance", "shoulder_lift_joint")]
    return make_case(1, robot="ur5", effects=effects, noncentrality=5.0 * poses, poses=poses).dataset


@pytest.fixture(scope="module")
def measured() -> Dataset:
    return _measured(200)


@pytest.fixture(scope="module")
def many() -> Dataset:
    return _measured(16_800)


def test_an_arm_s_200_poses(benchmark: Any, measured: Dataset) -> None:
    warnings.simplefilter("ignore")
    found = benchmark.pedantic(gtpin.calibrate, args=(measured,), rounds=5, warmup_rounds=1)
    assert len(found.names) == 42


def test_an_arm_s_200_poses_by_least_squares(benchmark: Any, measured: Dataset) -> None:
    geometry = gtpin.Geometry.nominal(gtpin.load_robot("ur5"))
    R = Rotation.from_quat(measured.orientation.copy(), scalar_first=True)  # type: ignore[union-attr]

    def residual(x: Floats) -> Floats:
        poses = Kinematics(geometry.with_values(geometry.values + geometry.tolerance * x)).forward(measured.q)
        turn = (R * Rotation.from_matrix(poses.R).inv()).as_rotvec()
        return np.concatenate([((measured.position - poses.T) / 1.5e-5).ravel(), (turn / 5e-5).ravel(), x])

    found = benchmark.pedantic(lambda: least_squares(residual, np.zeros(len(geometry.names))), rounds=1)
    assert found.success


def test_an_arm_s_diagnosis_of_200_poses(benchmark: Any, measured: Dataset) -> None:
    warnings.simplefilter("ignore")
    found = benchmark.pedantic(gtpin.diagnose, args=(measured,), rounds=2)
    assert found.causes


def test_an_arm_s_16_800_poses(benchmark: Any, many: Dataset) -> None:
    warnings.simplefilter("ignore")
    found = benchmark.pedantic(gtpin.calibrate, args=(many,), rounds=1)
    assert benchmark.stats.stats.min < 20.0
    assert len(found.names) == 42


def test_an_arm_s_diagnosis_of_16_800_poses(benchmark: Any, many: Dataset) -> None:
    warnings.simplefilter("ignore")
    found = benchmark.pedantic(gtpin.diagnose, args=(many,), rounds=1)
    assert benchmark.stats.stats.min < 120.0
    assert found.causes


def test_an_arm_s_derivative_by_its_placements(benchmark: Any, measured: Dataset) -> None:
    kinematics = Kinematics(gtpin.Geometry.nominal(gtpin.load_robot("ur5")))
    found = benchmark(lambda: kinematics.geometry_jacobian(measured.q, kinematics.forward(measured.q)))
    assert found.shape == (len(measured), 6, 42)


def test_an_arm_s_derivative_by_a_loop_of_pinocchio(benchmark: Any, measured: Dataset) -> None:
    robot = gtpin.load_robot("ur5")
    model, frame = robot.model, robot.model.getFrameId(robot.tcp_frame)
    data = model.createData()

    def regressor() -> Floats:
        found = np.empty((len(measured), 6, 6 * (model.njoints - 1)))
        for row, q in enumerate(measured.q):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            found[row] = pin.computeFrameKinematicRegressor(model, data, frame, pin.LOCAL)
        return found

    found = benchmark(regressor)
    kinematics = Kinematics(gtpin.Geometry.nominal(robot))
    poses = kinematics.forward(measured.q)
    own = kinematics.geometry_jacobian(measured.q, poses)
    # Its rows are in the axes of the TCP, and it has no columns of the tool.
    np.testing.assert_allclose(np.hstack([poses.R @ found[:, :3], poses.R @ found[:, 3:]]), own[:, :, :36], atol=1e-12)


def test_an_arm_s_diagnosis_of_440_poses(benchmark: Any, tmp_path: Path) -> None:
    warnings.simplefilter("ignore")
    one = telescope_arm.measured(2, 3.2e-3, 0.5, 2.0e-3)
    ids, conditions = np.array([f"p{n}" for n in range(len(one.q))]), {"position_sigma": one.sigma, "frame": "free"}
    urdf = str(telescope_arm.write(tmp_path))
    dataset = Dataset(urdf, ids, one.q, one.position, None, {"time": one.time}, conditions)
    found = benchmark.pedantic(gtpin.diagnose, args=(dataset,), rounds=1)
    assert found.verdict == "unknown"


def test_an_arm_s_derivative_by_figaroh(benchmark: Any, measured: Dataset) -> None:
    warnings.simplefilter("ignore")
    figaroh = pytest.importorskip("figaroh.calibration.calibration_tools")
    robot = gtpin.load_robot("ur5")
    model = robot.model
    settings = {
        "NbSample": len(measured),
        "IDX_TOOL": model.getFrameId(robot.tcp_frame),
        "start_frame": "universe",
        "end_frame": robot.tcp_frame,
        "calib_model": "full_params",
        "measurability": [True] * 6,
        "q0": robot.neutral,
        "config_idx": list(range(model.nq)),
    }

    def regressor() -> Floats:
        made = figaroh.calculate_identifiable_kinematics_model(measured.q, model, model.createData(), settings)
        return np.asarray(made, dtype=np.float64)

    found = benchmark(regressor).reshape(6, len(measured), 36).transpose(1, 0, 2)
    kinematics = Kinematics(gtpin.Geometry.nominal(robot))
    poses = kinematics.forward(measured.q)
    own = kinematics.geometry_jacobian(measured.q, poses)
    # FIGAROH's rows are in the axes of the TCP, and it has no columns of the tool.
    np.testing.assert_allclose(np.hstack([poses.R @ found[:, :3], poses.R @ found[:, 3:]]), own[:, :, :36], atol=1e-12)
