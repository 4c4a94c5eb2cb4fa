"""An arm without loops is identified by the same calibration."""

import numpy as np
import pytest
from monte_carlo import Study
from scipy.spatial.transform import Rotation
from virtual_arm import ROBOT, Arm
from virtual_gantry import ORIENTATION_SIGMA, POSITION_SIGMA

import gtpin

OFF = 5e-4
"""Standard deviation of each joint's placement and of the tool's, m and rad: the tolerance where no URDF gives one."""


def arm_case(seed, count=50):
    """A UR5 whose joints and tool are off by normal draws, and its measured poses."""
    rng = np.random.default_rng(seed)
    arm = Arm.drawn(rng, OFF, tool=True)
    q = rng.uniform(-2.0, 2.0, (count, 6))
    return arm, arm.measured(q, rng, (POSITION_SIGMA, ORIENTATION_SIGMA), free=False)


@pytest.mark.slow
def test_the_joint_placements_of_an_arm_are_identified():
    calibrations, machines = [], []
    nominal = gtpin.Model(gtpin.Geometry.nominal(ROBOT))
    for seed in range(25):
        arm, dataset = arm_case(seed)
        found = gtpin.calibrate(dataset.take(slice(0, 40)))
        assert set(found.names) == set(arm.deviations)
        calibrations.append(found)
        machines.append(arm)
        # Ten poses that were not fitted: from millimetres to less than the noise's length.
        q = dataset.q[40:]
        (T, R), held = arm.poses(q), found.model.predict(q)
        off, before = (np.sqrt(((at - T) ** 2).sum(axis=1).mean()) for at in (held.T, nominal.predict(q).T))
        assert off < 26e-6 < 5e-4 < before
        assert Rotation.from_matrix(held.R @ np.swapaxes(R, 1, 2)).magnitude().max() < 5 * ORIENTATION_SIGMA
    study = Study(calibrations, machines)
    study.assert_covers()
    study.assert_unbiased()
    study.assert_fits()


def test_a_calibrated_arm_is_written_and_read_again(tmp_path):
    _, dataset = arm_case(1)
    found = gtpin.calibrate(dataset)
    gtpin.write_model(found.model, tmp_path)
    expected = found.model.predict(dataset.q)
    assert np.abs(gtpin.read_model(tmp_path).predict(dataset.q).minus(expected)).max() < 1e-12
    assert np.abs(gtpin.read_model(tmp_path / "robot.urdf").predict(dataset.q).minus(expected)).max() < 1e-9
