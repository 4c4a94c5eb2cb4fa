"""A robot with a single moving joint loads, moves, is simulated, calibrated and asked for its poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import gtpin
from gtpin import errors
from gtpin.bench.simulator import simulate
from gtpin.robot.description import RobotDescription

Floats = np.ndarray
URDF = """<robot name="one">
  <link name="base"/><link name="arm"/>
  <joint name="drive" type="{kind}"><parent link="base"/><child link="arm"/><origin xyz="0.1 0.2 0.3" rpy="0 0.5 0"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <link name="tool"/><joint name="fix" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.4 0 0.1"/></joint>
</robot>"""


def poses(kind: str, q: Floats) -> tuple[Floats, Floats]:
    """Positions (N, 3) and rotations (N, 3, 3) of the tool, by scipy."""
    foot = Rotation.from_euler("y", 0.5)
    turn = Rotation.from_rotvec(q * [[0.0, 0.0, 1.0]]) if kind == "revolute" else Rotation.identity(len(q))
    slide = q * [[0.0, 0.0, 1.0]] if kind == "prismatic" else 0.0 * q
    return np.array([0.1, 0.2, 0.3]) + foot.apply(slide + turn.apply([0.4, 0.0, 0.1])), (foot * turn).as_matrix()


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_it_moves_as_it_should(kind: str) -> None:
    robot = gtpin.Robot(RobotDescription.parse(URDF.format(kind=kind)))
    q = np.linspace(-1.0, 1.0, 9)[:, None]
    found = gtpin.Model(gtpin.Geometry.nominal(robot)).predict(q)
    T, R = poses(kind, q)
    np.testing.assert_allclose(found.T, T, atol=1e-12)
    np.testing.assert_allclose(found.R, R, atol=1e-12)
    step = 1e-6
    slope = (poses(kind, q + step)[0] - poses(kind, q - step)[0]) / (2.0 * step)
    jacobians = np.array([gtpin.home(robot).moved_to(row).jacobian[:3, 0] for row in q])
    np.testing.assert_allclose(jacobians, slope, atol=1e-9)


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_it_is_simulated_and_calibrated(kind: str) -> None:
    """Chi-square over some 500 freedoms lies within 25 % of 1 but for 1 in 10,000 draws (sd sqrt(2 / 500) = 6 %)."""
    robot = gtpin.Robot(RobotDescription.parse(URDF.format(kind=kind)))
    made = simulate(robot, "one", poses=80, seed=2)
    found = gtpin.calibrate(made.dataset, robot)
    assert 0.8 < found.chi2_per_dof < 1.25
    off = found.model.predict(made.commands.q).T - made.truth.T
    assert np.sqrt((off**2).mean()) < 1.5e-5  # less than one measurement's noise, by 80 of them


def test_a_chain_so_long_that_its_parser_s_stack_overflows_is_refused() -> None:
    links = "".join(f'<link name="l{i}"/>' for i in range(5001))
    joints = "".join(
        f'<joint name="j{i}" type="fixed"><parent link="l{i}"/><child link="l{i + 1}"/></joint>' for i in range(5000)
    )
    with pytest.raises(errors.RobotError, match="5000 joints"):
        RobotDescription.parse(f'<robot name="long">{links}{joints}</robot>')
