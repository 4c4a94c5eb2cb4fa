"""MJCF: Pinocchio's own reader makes the same mechanism of it, in the same coordinates as MuJoCo."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from drawn_machines import draw, without_scales
from with_effects import OF_GANTRY, active

import gtpin
from gtpin.export import export

pytestmark = pytest.mark.filterwarnings("ignore:.*left out", "ignore:.*does not (hold|move with)", "ignore:.*to within")
FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"
ROBOTS = (*gtpin.robot_names(), "five-bar", "ur5", "panda")
FLOATING = "platform_pose"
"""The joint of a platform that floats: a composite of three slides and a ball joint with this name."""


@cache
def machine(name: str) -> tuple[gtpin.Model, np.ndarray]:
    """A robot with a geometry of its own (the five-bar's is nominal: its loop has no gap across its plane), and commands."""
    if name in gtpin.robot_names():
        drawn = draw(name)
        return drawn.model, drawn.q[:10]
    if name == "panda":
        robot = gtpin.load_robot(name, tcp="panda_hand_tcp", actuators=[f"panda_joint{i}" for i in range(1, 8)])
    else:
        robot = gtpin.load_robot(FIVE_BAR if name == "five-bar" else name)
    geometry, rng = gtpin.Geometry.nominal(robot), np.random.default_rng(5)
    off = 0.0 if name == "five-bar" else rng.uniform(-0.5, 0.5, len(geometry.names)) * geometry.tolerance
    low, high = (np.where(np.isfinite(x), x, y) for x, y in ((robot.lower, -3.0), (robot.upper, 3.0)))
    q = robot.home_q + rng.uniform(-0.1, 0.1, (10, robot.n_actuators)) * (high - low)
    return without_scales(gtpin.Model(geometry.with_values(geometry.values + off))), q


class Read:
    """A robot's MJCF as Pinocchio reads it, and its URDF as gtpin does."""

    def __init__(self, model: gtpin.Model, folder: Path) -> None:
        for suffix in (".xml", ".urdf"):
            export(model, folder / f"robot{suffix}")
        driven = [] if model.robot.constraints else [a.joint for a in model.robot.actuators]
        self.robot = gtpin.load_robot(folder / "robot.urdf", tcp=model.robot.tcp_frame, actuators=driven)
        self.model, self.loops, _ = pin.buildModelAndConstraintsFromMJCF(str(folder / "robot.xml"))
        self.data = self.model.createData()

    def joint(self, name: str) -> int:
        """The joint that stands for one of gtpin's."""
        return int(self.model.getJointId(f"Composite_{name}_x" if name == FLOATING else name))

    def configuration(self, own: np.ndarray) -> np.ndarray:
        """Pinocchio's coordinates where gtpin's are ``own``: of a floating platform they count from home."""
        x, robot = np.array(self.model.referenceConfigurations["home"]), self.robot.model
        for name, joint in zip(list(robot.names)[1:], list(robot.joints)[1:], strict=True):
            at = self.model.idx_qs[self.joint(name)]
            here = own[joint.idx_q : joint.idx_q + joint.nq]
            if joint.nv == 1:
                x[at] = np.arctan2(here[1], here[0]) if joint.nq == 2 else here[0]
                continue
            home = gtpin.home(self.robot).configuration[joint.idx_q : joint.idx_q + joint.nq]
            there, start = (robot.jointPlacements[joint.id] * pin.XYZQUATToSE3(c) for c in (here, home))
            x[at : at + 3] = there.translation - start.translation
            x[at + 3 : at + 7] = pin.Quaternion(start.rotation.T @ there.rotation).coeffs()
        return x

    def open(self, x: np.ndarray) -> float:
        """Largest distance between the two points of a loop, m."""
        pin.framesForwardKinematics(self.model, self.data, x)
        at = self.data.oMi
        ends = ((at[c.joint1_id] * c.joint1_placement, at[c.joint2_id] * c.joint2_placement) for c in self.loops)
        return max((float(np.abs(one.translation - other.translation).max()) for one, other in ends), default=0.0)


@pytest.fixture(scope="module", params=ROBOTS)
def read(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Read:
    return Read(machine(request.param)[0], tmp_path_factory.mktemp("read"))


@pytest.fixture
def q(read: Read, request: pytest.FixtureRequest) -> np.ndarray:
    return machine(request.node.callspec.params["read"])[1]


def test_pinocchio_has_the_joints_the_masses_and_the_loops(read: Read) -> None:
    robot = read.robot.model
    assert (read.model.njoints, read.model.nv) == (robot.njoints, robot.nv)
    assert len(read.loops) == len(read.robot.description.loops)
    for name, inertia in zip(list(robot.names)[1:], list(robot.inertias)[1:], strict=True):
        assert read.model.inertias[read.joint(name)].mass == pytest.approx(inertia.mass, rel=1e-9, abs=1e-11)
    np.testing.assert_array_equal(read.model.gravity.linear, robot.gravity.linear)


def test_home_is_the_keyframe_and_the_configuration_of_the_file(read: Read) -> None:
    x = read.model.referenceConfigurations["home"]
    np.testing.assert_allclose(x, read.model.referenceConfigurations["qpos0"], rtol=0, atol=1e-15)
    np.testing.assert_allclose(x, read.configuration(gtpin.home(read.robot).configuration), rtol=0, atol=1e-9)
    assert read.open(x) < 1e-12


def test_at_the_robots_coordinates_loops_close_and_the_tcp_and_the_masses_are_where_the_model_is(
    read: Read, q: np.ndarray
) -> None:
    frame = read.model.getFrameId(read.robot.tcp_frame, pin.FrameType.BODY)
    for one in q:
        posture = gtpin.home(read.robot).moved_to(one)
        assert read.open(read.configuration(posture.configuration)) < 1e-9
        there = read.data.oMf[frame]
        np.testing.assert_allclose(there.translation, posture.T, rtol=0, atol=1e-9)
        np.testing.assert_allclose(there.rotation, posture.R, rtol=0, atol=1e-9)
        robot = read.robot.model
        centre = pin.centerOfMass(robot, robot.createData(), posture.configuration)
        found = pin.centerOfMass(read.model, read.data, read.configuration(posture.configuration))
        np.testing.assert_allclose(found, centre, rtol=0, atol=1e-9)


EFFECTS = [
    *((name, "", "", 0.0) for name in ROBOTS),
    *OF_GANTRY,
    ("stewart", "backlash", "leg2", -5e-5),
    ("linear_delta", "link_compliance", "link2a", 4e-6),
    ("ur5", "linearity", "elbow_joint", 1e-4),
    ("ur5", "backlash", "elbow_joint", 1e-4),
    ("ur5", "joint_compliance", "shoulder_lift_joint", 3e-6),
    ("ur5", "bearing_compliance", "shoulder_pan_joint", 1e-5),
    ("ur5", "link_compliance", "arm", 2e-6),
]
"""Robots without effects, and each effect that MJCF holds: robot, effect, site, its first coefficient."""


@pytest.mark.parametrize(("name", "effect", "site", "first"), EFFECTS)
def test_the_same_coordinates_place_all_bodies_alike_in_mujoco_and_in_pinocchio(
    name: str, effect: str, site: str, first: float, tmp_path: Path
) -> None:
    mujoco = pytest.importorskip("mujoco")
    model, q = machine(name)
    if effect:
        came = {f"approach{i + 1}": np.resize([1.0, -1.0, -1.0], len(q)) for i in range(q.shape[1])}
        own = active(model, q, effect, site, covariates=came, drawn=lambda sigma: first * sigma / sigma[0])
        model = replace(model, effects=(own,))
    export(model, tmp_path / "robot.xml")
    simulated = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    one, read = mujoco.MjData(simulated), pin.buildModelFromMJCF(str(tmp_path / "robot.xml"))
    assert (read.nq, read.nv) == (simulated.nq, simulated.nv)
    other, rng = read.createData(), np.random.default_rng(3)
    swapped = np.arange(read.nq)
    for joint in (simulated.joint(i) for i in range(simulated.njnt)):
        if joint.type[0] == mujoco.mjtJoint.mjJNT_BALL:  # MuJoCo's quaternions begin with w, Pinocchio's end with it
            swapped[joint.qposadr[0] + np.arange(4)] = joint.qposadr[0] + np.array([1, 2, 3, 0])
    for _ in range(5):
        one.qpos[:] = simulated.qpos0
        mujoco.mj_integratePos(simulated, one.qpos, rng.normal(size=simulated.nv), 0.5)
        mujoco.mj_kinematics(simulated, one)
        pin.framesForwardKinematics(read, other, one.qpos[swapped])
        for body in (simulated.body(i).name for i in range(1, simulated.nbody)):
            there = other.oMf[read.getFrameId(body, pin.FrameType.BODY)]
            np.testing.assert_allclose(there.translation, one.body(body).xpos, rtol=0, atol=1e-9)
            np.testing.assert_allclose(there.rotation, one.body(body).xmat.reshape(3, 3), rtol=0, atol=1e-9)


def test_the_file_has_the_links_of_the_robot(read: Read) -> None:
    links, there = (
        {frame.name for frame in model.frames if frame.type == pin.FrameType.BODY}
        for model in (read.robot.model, read.model)
    )
    assert links - {"world", "universe"} <= there
