"""An arm with a gripper whose fingers are loops: without a command of its own, the gripper rests, and its mass stays."""

from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

import numpy as np
import pytest
from urdfs import joint, loop, own, urdf

import gtpin
from gtpin.robot.resting import remove_resting_loops

mujoco = pytest.importorskip("mujoco")

SCENE = """<mujoco><compiler angle="radian"/><default><joint axis="0 0 1" range="-2 2"/></default>
<worldbody>
 <body name="upper" pos="0 0 0.2"><inertial pos="0.1 0 0" mass="2" LARGE/><joint name="first" axis="0 1 0"/>
  <body name="fore" pos="0.3 0 0"><inertial pos="0.1 0 0" mass="1" LARGE/><joint name="second" axis="0 1 0"/>
   <site name="tool" pos="0.2 0 0"/>
   <body name="crank" pos="0.2 0 0"><inertial pos="0 0.02 0" mass="0.3" SMALL/><joint name="crank"/>
    <body name="coupler" pos="0 0.05 0"><inertial pos="0.03 0 0" mass="0.1" SMALL/><joint name="coupler"/></body></body>
   <body name="rocker" pos="0.1 0 0"><inertial pos="0.1 0.02 0" mass="0.1" SMALL/><joint name="rocker"/></body>
   <body name="other" pos="0.2 -0.05 0"><inertial pos="0 0 0" mass="0.2" SMALL/><joint name="other"/></body>
  </body></body>
</worldbody>
<tendon><fixed name="split"><joint joint="crank" coef="0.5"/><joint joint="other" coef="0.5"/></fixed></tendon>
<equality><connect body1="coupler" body2="rocker" anchor="0.1 0 0"/><joint joint1="crank" joint2="other"/></equality>
<actuator><position joint="first"/><position joint="second"/><motor tendon="split"/></actuator></mujoco>"""
SCENE = SCENE.replace("LARGE", 'diaginertia="0.01 0.01 0.01"').replace("SMALL", 'diaginertia="1e-4 1e-4 1e-4"')
"""Like many grippers: a tendon drives both fingers, each finger is a four-bar, and bodies have the names of their joints."""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "scene.xml").write_text(SCENE, encoding="utf-8")
    return tmp_path / "scene.xml"


@pytest.mark.parametrize("actuators", [None, ["first", "second"], ["second", "first"]])
def test_a_gripper_without_a_command_rests_and_weighs_on_the_arm(file: Path, actuators: list[str] | None) -> None:
    robot = gtpin.load_robot(file, tcp="tool", actuators=actuators or ())
    assert robot.sites == tuple(actuators or ("first", "second"))
    assert not robot.constraints
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    at = [model.joint(name).qposadr[0] for name in robot.sites]
    for q in np.random.default_rng(1).uniform(-1.0, 1.0, (4, 2)):
        data.qpos[at] = q
        mujoco.mj_forward(model, data)
        posture = gtpin.home(robot).moved_to(q)
        np.testing.assert_allclose(posture.T, data.site("tool").xpos, rtol=0, atol=1e-12)
        np.testing.assert_allclose(gtpin.static_forces(posture).actuators, data.qfrc_bias[at], rtol=0, atol=1e-9)


def test_a_gripper_with_a_command_keeps_its_loop(file: Path) -> None:
    robot = gtpin.load_robot(file, tcp="coupler", actuators=["first", "second", "other"])
    assert len(robot.constraints) == 1
    assert len(robot.sites) == 3


def test_a_model_of_an_arm_with_a_gripper_is_written_and_read_again(file: Path, tmp_path: Path) -> None:
    model = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(file, tcp="tool")))
    gtpin.write_model(model, tmp_path / "model")
    q = [[0.3, -0.5]]
    assert np.abs(gtpin.read_model(tmp_path / "model").predict(q).minus(model.predict(q))).max() < 1e-12


def left(driven: set[str], more: str = "") -> list[str]:
    """The loops that stay of a four-bar on the root, and of one on its coupler; ``more`` joints by ``<mimic>``."""
    follows = f'<mimic joint="{more}"/>' if more else ""
    joints = (
        ("a", "base", "A"),
        ("b", "A", "B"),
        ("c", "base", "C"),
        ("d", "B", "D"),
        ("e", "B", "E"),
        ("f", "E", "F"),
    )
    parts = [joint(*names, inside=follows if names[0] == "c" else "") for names in joints]
    parts += [loop("B", "0 0 0", "C", "0 0 0", "one"), loop("D", "0 0 0", "F", "0 0 0", "two")]
    root: Element = fromstring(urdf("four", *parts, own([], more='<plane loop="two"/>')))
    remove_resting_loops(root, driven, "here")
    kept = [loop.get("name", "") for loop in root.findall("loop_joint")]
    assert (root.find("gtpin/plane") is not None) == ("two" in kept)
    return kept


def test_loops_stay_that_a_driven_joint_moves() -> None:
    assert left({"a"}) == ["one"]
    assert left({"d"}) == ["two"]
    assert left({"a", "e"}) == ["one", "two"]
    assert left(set()) == []


def test_a_loop_stays_where_one_side_follows_the_other() -> None:
    assert left({"a"}, more="a") == ["one"]
    assert left({"d"}, more="a") == ["two"]
