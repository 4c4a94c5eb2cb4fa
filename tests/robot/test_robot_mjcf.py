"""MJCF files make the robots that MuJoCo makes of them: poses, loads, limits, loops."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import gtpin
from gtpin.errors import RobotError
from gtpin.robot.description import RobotDescription

ARM = """<mujoco model="arm"><compiler eulerseq="zYx"/><option gravity="1 2 -9"/>
<default><joint damping="1" axis="0 1 0"/><geom density="700"/>
 <default class="slow"><joint range="-90 60"/><default class="slower"><joint range="-10 10" axis="1 1 0"/></default></default>
</default>
<worldbody><geom type="plane" size="1 1 1"/><light pos="0 0 3"/>
 <body name="foot" pos="0.1 0.2 0.3" euler="10 20 30"><geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0" axisangle="1 2 3 40"/>
  <body name="a" pos="0 0 0.2" quat="1 0.2 0.3 0.4" childclass="slow">
   <joint name="one"/><joint name="two" type="hinge" pos="0.1 0.2 0.3" axis="1 0 2" ref="20" limited="false"/>
   <geom type="capsule" fromto="0 0 0 0.1 0.2 0.5" size="0.05"/><geom type="sphere" size="0.1" pos="0.3 0 0" mass="2"/>
   <body name="b" pos="0.3 0 0" zaxis="1 1 1"><joint name="three" class="slower" type="slide" ref="0.1" range="-1 2"/>
    <inertial pos="0.1 0.2 0.3" mass="3" diaginertia="0.1 0.2 0.25" quat="0.5 0.1 0.2 0.3"/><geom type="sphere" size="1"/>
    <body name="c" pos="0 0.2 0" xyaxes="1 1 0 0 1 1"><joint name="four"/><geom type="cylinder" size="0.1 0.2"/>
     <geom type="ellipsoid" size="0.1 0.2 0.3" pos="0 0 0.2"/><site name="grip" pos="0 0.1 0.2" euler="5 6 7"/>
     <site pos="1 1 1"/></body></body></body></body>
</worldbody>
<actuator><motor joint="four"/></actuator><keyframe><key qpos="0 0 0 0"/></keyframe></mujoco>"""


@pytest.fixture
def arm(tmp_path: Path) -> tuple[gtpin.Robot, mujoco.MjModel]:
    file = tmp_path / "scene.xml"
    file.write_text(ARM, encoding="utf-8")
    return gtpin.load_robot(file), mujoco.MjModel.from_xml_path(str(file))


def test_ranges_are_in_the_unit_of_the_file(arm: tuple[gtpin.Robot, mujoco.MjModel]) -> None:
    robot, model = arm
    for i, name in enumerate(robot.sites):
        limited, (low, high) = model.joint(name).limited[0], model.joint(name).range
        expected = (low, high) if limited else (-np.inf, np.inf)
        np.testing.assert_allclose((robot.lower[i], robot.upper[i]), expected, rtol=1e-12)


FIVE = """<mujoco model="five_bar"><compiler angle="radian"/><default><joint axis="0 0 1"/></default>
<worldbody>
 <body name="left" pos="-0.1 0 0" euler="0 0 2.2"><joint name="drive1" range="-0.6 0.6"/>
  <body name="left_far" pos="0.2 0 0" euler="0 0 -BEND"><joint name="elbow1"/><site name="tip" pos="0.3 0 0"/></body></body>
 <body name="right" pos="0.1 0 0" euler="0 0 0.9415926535897931"><joint name="drive2" range="-0.6 0.6"/>
  <body name="right_far" pos="0.2 0 0" euler="0 0 BEND"><joint name="elbow2"/></body></body>
</worldbody>
<equality><connect name="pin" {ends}/><weld body1="left" body2="right" active="false"/></equality>
<actuator><position joint="drive2"/><position joint="drive1"/><motor joint="drive1"/></actuator></mujoco>""".replace(
    "BEND", repr(2.2 - float(np.arccos((0.1 - 0.2 * np.cos(2.2)) / 0.3)))
)
BODIES = 'body1="left_far" body2="right_far" anchor="0.3 0 0"'


def circles(q1: float, q2: float) -> np.ndarray:
    """Where the far links of the five-bar meet, by hand: two circles of 0.3 m about the elbows, the upper point."""
    a = np.array([-0.1, 0.0]) + 0.2 * np.array([np.cos(2.2 + q1), np.sin(2.2 + q1)])
    b = np.array([0.1, 0.0]) + 0.2 * np.array([np.cos(np.pi - 2.2 + q2), np.sin(np.pi - 2.2 + q2)])
    half, across = (b - a) / 2.0, np.array([-(b - a)[1], (b - a)[0]]) / np.linalg.norm(b - a)
    return a + half + across * np.sqrt(0.09 - half @ half)


def test_connect_closes_a_loop_whose_drives_the_file_names() -> None:
    robot = gtpin.Robot(RobotDescription.parse(FIVE.format(ends=BODIES)), "tip")
    assert robot.sites == ("drive2", "drive1")
    for q2, q1 in np.random.default_rng(3).uniform(-0.4, 0.4, (10, 2)):
        np.testing.assert_allclose(gtpin.home(robot).moved_to([q2, q1]).T[:2], circles(q1, q2), rtol=0, atol=1e-9)


def test_included_files_are_read_from_the_folder_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM, encoding="utf-8")
    (tmp_path / "scene.xml").write_text('<mujoco model="scene"><include file="arm.xml"/></mujoco>', encoding="utf-8")
    assert gtpin.load_robot(tmp_path / "scene.xml").n_actuators == 4
    (tmp_path / "ring.xml").write_text('<mujoco><include file="ring.xml"/></mujoco>', encoding="utf-8")
    for name, said in (("ring.xml", "included twice"), ("lost.xml", "the file is missing")):
        with pytest.raises(RobotError, match=said):
            gtpin.load_robot(tmp_path / name)
    (tmp_path / "hole.xml").write_text('<mujoco><include file="nothing.xml"/></mujoco>', encoding="utf-8")
    with pytest.raises(RobotError, match=r"nothing\.xml: the file is missing; mend <include>"):
        gtpin.load_robot(tmp_path / "hole.xml")


def test_a_model_of_an_mjcf_is_written_and_read_again(tmp_path: Path) -> None:
    robot = gtpin.Robot(RobotDescription.parse(FIVE.format(ends=BODIES)), "tip")
    geometry = gtpin.Geometry.nominal(robot)
    geometry = geometry.with_values(
        geometry.values + 1e-3 * np.random.default_rng(4).standard_normal(geometry.values.size)
    )
    model = gtpin.Model(geometry)
    gtpin.write_model(model, tmp_path)
    q = np.random.default_rng(5).uniform(-0.3, 0.3, (5, 2))
    for name in ("", "robot.urdf"):
        assert np.abs(gtpin.read_model(tmp_path / name).predict(q).minus(model.predict(q))).max() < 1e-9


SPOILT = {
    "entities": ARM.replace("<mujoco", '<!DOCTYPE mujoco [<!ENTITY a "b">]><mujoco'),
    "broken": ARM.replace("</worldbody>", ""),
    "nothing that moves": "<mujoco><worldbody><body/></worldbody></mujoco>",
    "an axis of no length": ARM.replace('axis="1 0 2"', 'axis="0 0 0"'),
    "a place in words": ARM.replace('pos="0.1 0.2 0.3" euler', 'pos="here" euler'),
    "a place in two numbers": ARM.replace('pos="0.1 0.2 0.3" euler', 'pos="1 2" euler'),
    "a place that is not finite": ARM.replace('pos="0.1 0.2 0.3" euler', 'pos="nan 0 0" euler'),
    "two bodies of one name": ARM.replace('<body name="c"', '<body name="a"'),
    "two joints of one name": ARM.replace('<joint name="four"/>', '<joint name="one"/>'),
    "a loop of an unknown body": FIVE.format(ends=BODIES.replace('"right_far"', '"nobody"')),
    "a loop without its place": FIVE.format(ends='body1="left_far" body2="right_far"'),
    "loops but no drives": FIVE.format(ends=BODIES).replace("<actuator>", "<other>").replace("</actuator>", "</other>"),
    "euler angles in an order that is none": ARM.replace('"zYx"', '"zYq"'),
    "a mass in words": ARM.replace('mass="3"', 'mass="heavy"'),
    "sizes that are negative": ARM.replace('type="sphere" size="0.1"', 'type="sphere" size="-0.1"').replace(
        'mass="2"', ""
    ),
}


@pytest.mark.parametrize("what", SPOILT)
def test_what_makes_no_robot_is_refused_in_one_line(
    what: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert SPOILT[what] != ARM
    file = tmp_path / "robot.xml"
    file.write_text(SPOILT[what], encoding="utf-8")
    with pytest.raises(RobotError) as caught:
        gtpin.load_robot(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)
    assert caught.value.hint
    assert capfd.readouterr() == ("", "")
