"""A URDF that tells no masses: effects of load are not testable, and that is said; everything else is diagnosed."""

import numpy as np
import pinocchio as pin
import pytest

import gtpin
from gtpin.data import Dataset, Instrument
from gtpin.robot.description import RobotDescription

TURNER = """<robot name="turner"><link name="base"/><link name="arm"/><joint name="turn" type="revolute">
<parent link="base"/><child link="arm"/><origin xyz="0.1 0.2 0.3" rpy="1.3 0.2 0.1"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint><link name="tool0"/><joint name="tool" type="fixed">
<parent link="arm"/><child link="tool0"/><origin xyz="0.4 0 0.1" rpy="0.5 0.1 -0.4"/></joint></robot>"""
OF_LOAD = {"joint_compliance", "bearing_compliance", "joint_clearance", "link_compliance"}


def test_a_robot_without_masses_is_told_and_its_effects_of_load_are_not_tested() -> None:
    rng = np.random.default_rng(2)
    robot = gtpin.Robot(RobotDescription.parse(TURNER, "turner"))
    q = rng.uniform(-2.5, 2.5, (40, 1))
    plain = gtpin.Model(gtpin.Geometry.nominal(robot)).predict(q)
    noise = [pin.exp6(np.repeat([1.5e-5, 5e-5], 3) * rng.standard_normal(6)) for _ in q]
    seen = [pin.SE3(R, T) * off for T, R, off in zip(plain.T, plain.R, noise, strict=True)]
    dataset = Dataset(
        robot="turner",
        pose=np.arange(40),
        q=q,
        position=np.array([M.translation for M in seen]),
        orientation=np.array([np.roll(pin.Quaternion(M.rotation).coeffs(), 1) for M in seen]),
        instrument=Instrument(position_sigma=1.5e-5, orientation_sigma=5e-5),
    )
    with pytest.warns(gtpin.GtpinWarning, match="links of turner have no masses: effects of load"):
        found = gtpin.diagnose(dataset, robot)
    reasons = {c.effect: c.reason for c in found.candidates if c.effect in OF_LOAD}
    assert set(reasons) == OF_LOAD
    assert all(reason is not None and reason.kind == "no_masses" for reason in reasons.values())
    assert any(c.reason is None for c in found.candidates)
