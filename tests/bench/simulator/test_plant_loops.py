"""Loops that are no rods: the plant's posture is that of the URDF as Pinocchio closes it."""

import numpy as np

import gtpin
from gtpin.bench.simulator.loops import Loops
from gtpin.bench.simulator.poses import log
from gtpin.bench.simulator.simulate import TrueRobot, draw_machine
from gtpin.robot.description import RobotDescription


def spatial_loop(home: str = "") -> gtpin.Robot:
    """A crank, a coupler that hangs on it by a universal joint, and a rocker to which a ball joint leads: RUSR."""
    links = "".join(f'<link name="{name}"/>' for name in ("base", "crank", "cross", "coupler", "rocker"))
    joints = "".join(
        f'<joint name="{child}_joint" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/></joint>'
        for parent, child, xyz, rpy, axis in (
            ("base", "crank", "0 0 0", "0 0 0", "0 0 1"),
            ("crank", "cross", "0.2 0 0", "0 0 1.0", "0 0 1"),
            ("cross", "coupler", "0 0 0", "0 0 0", "0 1 0"),
            ("base", "rocker", "0.6 0 0", "0.3 0 1.9", "0 0 1"),
        )
    )
    loop = '<loop_joint name="ball" type="spherical"><link1 link="coupler" xyz="0.5 0 0"/><link2 link="rocker" xyz="0.45 0 0"/>'
    own = '</loop_joint><gtpin><actuator joint="crank_joint"/><platform link="rocker"/>'
    return gtpin.Robot(RobotDescription.parse(f'<robot name="rusr">{links}{joints}{loop}{own}{home}</gtpin></robot>'))


def test_poses_are_pinocchio_s_closed_postures() -> None:
    first = gtpin.home(spatial_loop())
    xyz, rotvec = (" ".join(map(repr, v.tolist())) for v in (first.T, log(first.R)))
    robot = spatial_loop(f'<home q="0" tcp_xyz="{xyz}" tcp_rotvec="{rotvec}"/>')
    home, q = gtpin.home(robot), np.linspace(-0.6, 0.6, 7)[:, None]
    found = Loops.of(robot, {}).predict(q)
    for i, row in enumerate(q):
        posture = home.moved_to(row)
        assert np.abs(found.T[i] - posture.T).max() < 1e-9
        assert np.abs(log(found.R[i] @ posture.R.T)).max() < 1e-9


def test_a_drawn_machine_closes_its_loop_and_moves_as_its_jacobian_says() -> None:
    machine = draw_machine(spatial_loop(), np.random.default_rng(1))
    q, step = np.linspace(-0.4, 0.4, 5)[:, None], 1e-5
    poses = machine.predict(q)
    assert poses.reached.all()
    slope = machine.predict(q + step).minus(machine.predict(q - step)) / (2.0 * step)
    np.testing.assert_allclose(machine.command_jacobian(q, poses)[:, :, 0], slope, atol=1e-6)
    assert np.abs(poses.T - TrueRobot(gtpin.Geometry.nominal(spatial_loop())).predict(q).T).max() > 1e-5


def test_commands_at_which_the_loop_is_open_have_no_pose() -> None:
    robot = spatial_loop()
    found = Loops.of(robot, {}).predict(np.array([[0.1], [0.2]]))
    assert found.reached.all()
    far = Loops.of(robot, {"placement[rocker_joint]": np.array([5.0, 0.0, 0.0, 0.0, 0.0, 0.0])})
    assert not far.predict(np.array([[0.1]])).reached.any()
