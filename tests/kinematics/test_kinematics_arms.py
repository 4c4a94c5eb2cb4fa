"""Robots without rods through the same code: arms, what their joints carry, and a planar four-bar linkage."""

import pickle
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from loaded_machines import closed_by_hand, differences, drawn

import gtpin
from gtpin.errors import ClosureError, ModelError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.model.model_folder import calibrated_urdf
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.library import urdf_path
from gtpin.robot.placement_frames import frame_of_joint, frame_of_tcp

Floats = np.ndarray
FINGER = ("panda_finger_joint1", "panda_finger_joint2")  # the second follows the first


@pytest.fixture(params=["ur5", "panda"])
def arm(request: pytest.FixtureRequest) -> tuple[gtpin.Robot, Path]:
    return gtpin.load_robot(request.param), urdf_path(request.param)


def every_joint(robot: gtpin.Robot, q: Floats) -> Floats:
    """(..., nv) coordinates of plain Pinocchio's model, which knows no mimic joints, in document order, at commands q."""
    return np.concatenate([q, q[..., -1:]], axis=-1) if FINGER[0] in robot.sites else q


def test_every_moving_joint_of_an_arm_is_an_actuator_in_document_order(arm: tuple[gtpin.Robot, Path]) -> None:
    robot, file = arm
    other = yourdfpy.URDF.load(str(file), load_meshes=False, load_collision_meshes=False, build_scene_graph=False)
    moving = [
        joint.name
        for joint in other.robot.joints
        if joint.type in ("revolute", "prismatic", "continuous") and joint.mimic is None
    ]
    assert list(robot.sites) == moving
    assert robot.rods == ()


@pytest.mark.slow
@pytest.mark.parametrize("away", [0.0, 1.0])
def test_joint_placements_of_an_arm_have_the_derivative_of_its_poses(
    arm: tuple[gtpin.Robot, Path], away: float
) -> None:
    robot, _ = arm
    nominal = gtpin.Geometry.nominal(robot)
    placed = {f"placement[{robot.model.names[j]}]" for j in robot.moving_joints}
    assert {name.split(".")[0] for name in nominal.names} == {*placed, "platform"}
    geometry = drawn(robot, 2) if away else nominal
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (2, robot.n_actuators))
    here = Kinematics(geometry)
    analytic = here.geometry_jacobian(q, here.forward(q))
    numeric = differences(lambda x: Kinematics(nominal.with_values(x)).forward(q), geometry.values, 1e-4)
    np.testing.assert_allclose(analytic, numeric, rtol=0, atol=1e-9)


def test_command_jacobian_of_an_arm_is_the_derivative_of_its_poses(arm: tuple[gtpin.Robot, Path]) -> None:
    robot, _ = arm
    here = Kinematics(gtpin.Geometry.nominal(robot))
    q = np.random.default_rng(4).uniform(-1.5, 1.5, (1, robot.n_actuators))
    analytic = here.command_jacobian(q, here.forward(q))
    np.testing.assert_allclose(analytic, differences(lambda x: here.forward(x[None]), q[0], 1e-4), rtol=0, atol=1e-9)


def test_an_arm_reaches_positions_and_rotations(arm: tuple[gtpin.Robot, Path]) -> None:
    robot, _ = arm
    posture = gtpin.home(robot).moved_to(np.linspace(-1.0, 0.8, robot.n_actuators))
    wanted = posture.moved_to(posture.q + 0.1)
    there = gtpin.reach(posture, wanted.T, wanted.R)
    np.testing.assert_allclose(there.T, wanted.T, rtol=0, atol=1e-10)
    np.testing.assert_allclose(there.R, wanted.R, rtol=0, atol=1e-10)
    if robot.revolute.all():  # a finger slides as far as it is told
        with pytest.raises(ClosureError):
            gtpin.reach(posture, wanted.T + 30.0)


def test_actuators_of_an_arm_hold_gravity_and_the_load(arm: tuple[gtpin.Robot, Path]) -> None:
    robot, file = arm
    model = pin.buildModelFromUrdf(str(file))
    data = model.createData()
    commands = np.linspace(-1.0, 1.0, robot.n_actuators)
    posture, q = gtpin.home(robot).moved_to(commands), every_joint(robot, commands)
    force = np.array([10.0, 20.0, -30.0])
    held = gtpin.static_forces(posture, force, payload=2.0).actuators
    frame = model.getFrameId(robot.tcp_frame, pin.FrameType.BODY)
    J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
    expected = pin.computeGeneralizedGravity(model, data, q) - J.T @ (force + 2.0 * np.array([0, 0, -9.81]))
    if len(q) > len(commands):  # the finger that is driven holds the other one too
        expected = np.append(expected[:-2], expected[-2:].sum())
    np.testing.assert_allclose(held, expected, rtol=0, atol=1e-9)


def test_an_exported_arm_predicts_what_the_model_predicts(arm: tuple[gtpin.Robot, Path], tmp_path: Path) -> None:
    robot, _ = arm
    geometry = drawn(robot, 5)
    file = tmp_path / "arm.urdf"
    file.write_text(calibrated_urdf(gtpin.Model(geometry)), encoding="utf-8")
    other = yourdfpy.URDF.load(str(file), load_meshes=False, load_collision_meshes=False, build_scene_graph=False)
    assert other.robot.links
    again = gtpin.load_robot(file)
    joints = fromstring(robot.description.xml).findall("joint")
    held = next(joint for joint in joints if joint.find("child").get("link") == robot.tcp_frame)
    # A link that is fixed moves with its joint; one that a joint moves gets a link of its own at the new TCP.
    assert again.tcp_frame == (robot.tcp_frame if held.get("type") == "fixed" else f"{robot.tcp_frame}_tcp")
    q = np.random.default_rng(6).uniform(-2.0, 2.0, (50, robot.n_actuators))
    difference = gtpin.Model(geometry).predict(q).minus(gtpin.Model(gtpin.Geometry.nominal(again)).predict(q))
    assert np.abs(difference).max() <= 1e-9


def test_a_robot_whose_joints_were_moved_pickles_with_them(arm: tuple[gtpin.Robot, Path]) -> None:
    robot, _ = arm
    model = gtpin.Model(drawn(robot, 7))
    q = np.random.default_rng(8).uniform(-2.0, 2.0, (5, robot.n_actuators))
    before = model.predict(q)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(model)).predict(q).T, before.T)


def test_a_four_bar_linkage_moves_as_two_circles_meet(four_bar: gtpin.Robot) -> None:
    """Twice round, on one side: where the loop is closed with its passive joints at zero, the pin is above the crank."""
    posture = gtpin.home(four_bar)
    for angle in np.linspace(0.0, 4.0 * np.pi, 60):
        posture = posture.moved_to([angle])
        at, turn = closed_by_hand(angle, 1.0)["rocker"]
        np.testing.assert_allclose(posture.T[:2], at, rtol=0, atol=1e-12)
        np.testing.assert_allclose(posture.R[:2, 0], [np.cos(turn), np.sin(turn)], rtol=0, atol=1e-12)


def test_commands_of_a_continuous_joint_may_go_round(four_bar: gtpin.Robot) -> None:
    posture = gtpin.home(four_bar)
    once, again = posture.moved_to([0.5]), posture.moved_to([0.5 + 2.0 * np.pi])
    np.testing.assert_allclose(once.T, again.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(once.R, again.R, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(again.q, [0.5 + 2.0 * np.pi])
    assert (four_bar.lower[0], four_bar.upper[0]) == (-np.inf, np.inf)


def test_commands_that_are_nan_give_nan_and_of_another_shape_an_error(arm: tuple[gtpin.Robot, Path]) -> None:
    model = gtpin.Model(gtpin.Geometry.nominal(arm[0]))
    q = np.zeros((3, arm[0].n_actuators))
    q[1, 2] = np.nan
    np.testing.assert_array_equal(model.predict(q).reached, [True, False, True])
    with pytest.raises(ModelError):
        model.predict(q[:, :-1])
    with pytest.raises(ModelError):
        model.predict(q[0])


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_no_commands_have_no_poses(name: str) -> None:
    robot = gtpin.load_robot(name)
    kinematics = gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics
    poses = kinematics.forward(np.zeros((0, robot.n_actuators)))
    assert poses.T.shape == (0, 3)


ARM = gtpin.load_robot(Path(__file__).parents[2] / "examples" / "effects" / "arm.urdf")
Q = np.random.default_rng(0).uniform(-1.2, 1.2, (4, 6))


def tcp(model: pin.Model, q: np.ndarray, tool: pin.SE3) -> pin.SE3:
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return data.oMi[ARM.tcp_joint] * tool


def joint_loads(force: Floats | None = None, payload: Floats | None = None) -> Floats:
    """(N, J + 1, 6) what the joints and the TCP carry at the commands Q."""
    own = Kinematics(gtpin.Geometry.nominal(ARM))
    return own.loads(Q, own.forward(Q), force, payload).joints


def energy(q: np.ndarray, payload: float, force: np.ndarray) -> float:
    """Potential energy of links, payload and a constant force, J."""
    data = ARM.model.createData()
    own = pin.computePotentialEnergy(ARM.model, data, q)
    T = tcp(ARM.model, q, ARM.tcp_placement).translation
    return float(own - payload * ARM.model.gravity.linear @ T - force @ T)


def test_what_a_joint_carries_about_its_axis_is_how_the_energy_falls() -> None:
    rng = np.random.default_rng(1)
    payload, force = rng.uniform(0.0, 5.0, len(Q)), 40.0 * rng.standard_normal((len(Q), 3))
    loads = joint_loads(force, payload)
    for i, q in enumerate(Q):
        for j, actuator in enumerate(ARM.actuators):
            step = np.zeros(6)
            step[j] = 1e-4
            fall = (energy(q - step, payload[i], force[i]) - energy(q + step, payload[i], force[i])) / 2e-4
            carried = loads[i, frame_of_joint(actuator.joint_id)] @ joint_axis(ARM.model, actuator.joint_id)
            np.testing.assert_allclose(carried, fall, rtol=0, atol=1e-5)


def test_the_first_joint_carries_the_whole_weight() -> None:
    loads = joint_loads(payload=np.full(len(Q), 3.0))
    weight = (sum(inertia.mass for inertia in ARM.model.inertias[1:]) + 3.0) * 9.81
    np.testing.assert_allclose(loads[:, 0, :3], np.tile([0.0, 0.0, -weight], (len(Q), 1)), rtol=0, atol=1e-9)


def test_the_tcp_carries_the_payload_and_the_force_in_its_own_axes() -> None:
    force = np.tile([10.0, -20.0, 5.0], (len(Q), 1))
    found, own = joint_loads(force, np.full(len(Q), 2.0))[:, -1], Kinematics(gtpin.Geometry.nominal(ARM))
    R, _ = own.motion(Q, own.forward(Q)).frame(frame_of_tcp(ARM))
    wanted = np.einsum("nji,nj->ni", R, force + np.array([0.0, 0.0, -2.0 * 9.81]))
    np.testing.assert_allclose(found[:, :3], wanted, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found[:, 3:], 0.0, rtol=0, atol=1e-13)
