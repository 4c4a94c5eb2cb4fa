"""An arm without loops is identified by the same calibration."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from monte_carlo import Study
from scipy.spatial.transform import Rotation
from virtual_gantry import ORIENTATION_SIGMA, POSITION_SIGMA, Machine

import gtpin
from gtpin.data import Instrument


def ur5():
    packages = [Path(p) for p in sys.path if p.endswith("site-packages")]
    tail = "cmeel.prefix/share/example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
    return next((p / tail for p in packages if (p / tail).is_file()), None)


@pytest.fixture(scope="module")
def robot():
    file = ur5()
    if file is None:
        pytest.skip("example-robot-data is not installed")
    return gtpin.load_robot(file)


OFF = 5e-4
"""Standard deviation of each joint's placement and of the tool's, m and rad: the tolerance where no URDF gives one."""
AXES = ("x", "y", "z", "rx", "ry", "rz")


def arm_case(robot, seed, count=50):
    """A UR5 whose joints and tool are off by normal draws, and its poses by Pinocchio's own forward kinematics."""
    rng = np.random.default_rng(seed)
    model = robot.model.copy()
    deviations = {}
    for joint in range(1, model.njoints):
        twist = OFF * rng.standard_normal(6)
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(twist)
        deviations |= {f"placement[{model.names[joint]}].{a}": t for a, t in zip(AXES, twist, strict=True)}
    frame = model.getFrameId(robot.tcp_frame)
    twist = OFF * rng.standard_normal(6)
    model.frames[frame].placement = model.frames[frame].placement * pin.exp6(twist)
    deviations |= {f"platform.{a}": t for a, t in zip(AXES, twist, strict=True)}
    data = model.createData()
    q = rng.uniform(-2.0, 2.0, (count, 6))
    T, R = np.empty((count, 3)), np.empty((count, 3, 3))
    for i, row in enumerate(q):
        pin.framesForwardKinematics(model, data, row)
        T[i], R[i] = data.oMf[frame].translation, data.oMf[frame].rotation
    noise = Rotation.from_rotvec(ORIENTATION_SIGMA * rng.standard_normal((count, 3)))
    dataset = gtpin.Dataset(
        robot="ur5.urdf",
        pose=[str(i) for i in range(count)],
        q=q,
        position=T + POSITION_SIGMA * rng.standard_normal((count, 3)),
        orientation=(noise * Rotation.from_matrix(R)).as_quat(scalar_first=True),
        instrument=Instrument(position_sigma=POSITION_SIGMA, orientation_sigma=ORIENTATION_SIGMA),
    )
    return deviations, dataset, (q, T, R)


@pytest.mark.slow
def test_the_joint_placements_of_an_arm_are_identified(robot):
    calibrations, machines = [], []
    for seed in range(25):
        deviations, dataset, (q, T, R) = arm_case(robot, seed)
        found = gtpin.calibrate(dataset.take(slice(0, 40)), robot)
        assert set(found.names) == set(deviations)
        calibrations.append(found)
        machines.append(Machine(None, deviations))
        # Ten poses that were not fitted: from millimetres to less than the noise's length.
        held = found.model.predict(q[40:])
        off = np.sqrt(((held.T - T[40:]) ** 2).sum(axis=1).mean())
        nominal = gtpin.Model(gtpin.Geometry.nominal(robot)).predict(q[40:]).T
        assert off < 26e-6 < 5e-4 < np.sqrt(((nominal - T[40:]) ** 2).sum(axis=1).mean())
        assert Rotation.from_matrix(held.R @ np.swapaxes(R[40:], 1, 2)).magnitude().max() < 5 * ORIENTATION_SIGMA
    study = Study(calibrations, machines)
    study.assert_covers()
    study.assert_unbiased()
    study.assert_fits()


def test_a_calibrated_arm_is_written_and_read_again(robot, tmp_path):
    _, dataset, (q, _, _) = arm_case(robot, 1)
    found = gtpin.calibrate(dataset, robot)
    gtpin.write_model(found.model, tmp_path)
    expected = found.model.predict(q)
    assert np.abs(gtpin.read_model(tmp_path).predict(q).minus(expected)).max() < 1e-12
    assert np.abs(gtpin.read_model(tmp_path / "robot.urdf").predict(q).minus(expected)).max() < 1e-9
