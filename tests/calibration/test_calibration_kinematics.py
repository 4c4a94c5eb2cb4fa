"""A calibration of rods with kinematics that were made without Pinocchio is the same, to rounding."""

import numpy as np
import pytest
from by_simulator import BySimulator
from virtual_gantry import case

import gtpin
from gtpin.kinematics.kinematics import Kinematics
from gtpin.model import model

OTHERS = ("tau", "stewart", "gantry_tau_6dof", "linear_delta")


@pytest.mark.slow
@pytest.mark.parametrize("free", [False, True], ids=["robot", "free"])
@pytest.mark.parametrize("scale", [None, "actuator"])
def test_a_calibration_with_the_simulator_s_own_kinematics_is_the_same(free, scale, monkeypatch):
    _, dataset = case(np.random.default_rng([3, free]), 40, free=free)
    one = gtpin.calibrate(dataset, scale=scale)
    monkeypatch.setattr(model, "kinematics_of", BySimulator)
    two = gtpin.calibrate(dataset, scale=scale)
    assert isinstance(two.model.kinematics, BySimulator)
    assert one.iterations == two.iterations
    # A millionth of a sigma: rounding of 1e-14 m in poses, through a fit whose conditions are some 1e6.
    np.testing.assert_allclose(two.values / one.sigma, one.values / one.sigma, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(two.sigma, one.sigma, rtol=1e-6)
    assert two.chi2 == pytest.approx(one.chi2, rel=1e-9)


@pytest.mark.parametrize("name", ["gantry_tau", *OTHERS])
def test_poses_and_derivatives_far_from_nominal_are_the_same(name):
    """Five tolerances off, where an axis is no longer the nominal one."""
    robot = gtpin.load_robot(name)
    nominal = gtpin.Geometry.nominal(robot, scale="actuator")
    rng = np.random.default_rng(4)
    geometry = nominal.with_values(nominal.values + 5.0 * nominal.tolerance * rng.standard_normal(len(nominal.values)))
    usual, other = Kinematics(geometry), BySimulator(geometry)
    middle, half = (robot.upper + robot.lower) / 2.0, (robot.upper - robot.lower) / 2.0
    q = middle + 0.4 * half * rng.uniform(-1.0, 1.0, (6, robot.n_actuators))
    poses = usual.forward(q)
    assert poses.reached.all()
    np.testing.assert_allclose(other.forward(q).T, poses.T, atol=1e-11)
    np.testing.assert_allclose(other.forward(q).R, poses.R, atol=1e-11)
    for derivative in ("command_jacobian", "geometry_jacobian"):
        expected = getattr(other, derivative)(q, poses)
        np.testing.assert_allclose(getattr(usual, derivative)(q, poses), expected, atol=1e-9 * np.abs(expected).max())
