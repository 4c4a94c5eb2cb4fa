"""Robots are loaded by name or path; what is no robot is refused in one line."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import gtpin
from gtpin.errors import RobotError
from gtpin.robot.description import RobotDescription
from gtpin.robot.library import urdf_path

GANTRY = urdf_path("gantry_tau").read_text(encoding="utf-8")
Refused = Callable[[str], RobotError]

ARM = """<robot name="arm"><link name="a"/><link name="b"/><link name="c"/>
<joint name="second" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>
<limit lower="0" upper="1" effort="1" velocity="1"/></joint>
<joint name="first" type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/></joint></robot>"""


def changed(old: str, new: str, text: str = GANTRY) -> str:
    assert old in text, old
    return text.replace(old, new)


def without(pattern: str) -> str:
    text, count = re.subn(pattern, "", GANTRY, flags=re.DOTALL)
    assert count
    return text


@pytest.fixture
def refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Refused:
    """Load a URDF's text that is no robot, and give its error after checking how it looks."""

    def load(text: str) -> RobotError:
        file = tmp_path / "robot.urdf"
        file.write_bytes(text.encode())
        capfd.readouterr()
        with pytest.raises(RobotError) as caught:
            gtpin.load_robot(file)
        said = str(caught.value)
        assert "\n" not in said
        assert said.startswith(str(file))
        assert caught.value.hint
        assert capfd.readouterr() == ("", "")
        return caught.value

    return load


def test_a_robot_is_found_by_name_and_by_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "mine.urdf"
    file.write_text(GANTRY, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for reference in ("gantry_tau", file, str(file), "mine.urdf", Path("mine.urdf"), "./mine.urdf"):
        assert gtpin.load_robot(reference).sites == ("cart1", "cart2", "cart3")


@pytest.mark.parametrize("name", ["gantry", "", "gantry_tau ", "GANTRY_TAU"])
def test_an_unknown_name_is_refused_with_the_names_that_there_are(name: str) -> None:
    with pytest.raises(RobotError, match="gantry_tau") as caught:
        gtpin.load_robot(name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("reference", ["missing.urdf", Path("missing"), "no/such/robot.urdf"])
def test_a_missing_file_is_refused(reference: str | Path) -> None:
    with pytest.raises(RobotError, match="the file is missing") as caught:
        gtpin.load_robot(reference)
    assert str(reference) in str(caught.value)


def test_a_folder_and_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="this is a folder"):
        gtpin.load_robot(tmp_path)
    (tmp_path / "latin.urdf").write_bytes('<robot name="Führung"/>'.encode("latin-1"))
    with pytest.raises(RobotError, match="not UTF-8"):
        gtpin.load_robot(tmp_path / "latin.urdf")


def test_a_byte_order_mark_and_other_line_ends_do_not_matter(tmp_path: Path) -> None:
    file = tmp_path / "windows.urdf"
    file.write_bytes(b"\xef\xbb\xbf" + GANTRY.replace("\n", "\r\n").encode())
    assert gtpin.load_robot(file).sites == ("cart1", "cart2", "cart3")


def test_broken_xml_is_refused_with_its_line(refused: Refused) -> None:
    error = refused(changed("</gtpin>", ""))
    assert error.row is not None
    assert error.row > 100


def test_an_xml_of_entities_that_explode_is_refused(refused: Refused) -> None:
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))
    head = f'<!DOCTYPE robot [<!ENTITY l0 "ha">{laughs}]>'
    assert "accepted" in str(refused(changed("<robot name", f"{head}<robot note='&l11;' name")))


def test_an_xml_that_reads_other_files_is_refused(refused: Refused) -> None:
    refused(
        changed("<robot name", '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot note="&x;" name')
    )


SPOILT = {
    "empty": "",
    "no robot inside": "<sdf/>",
    "no link": '<robot name="x"/>',
    "nothing that moves": '<robot name="x"><link name="a"/></robot>',
    "loops but no <gtpin>": without("<gtpin>.*</gtpin>"),
    "two <gtpin>": changed("</gtpin>", "</gtpin><gtpin/>"),
    "a doubled actuator": changed('<actuator joint="track2" site="cart2"/>', '<actuator joint="track1" site="other"/>'),
    "a doubled site": changed('joint="track2" site="cart2"', 'joint="track2" site="cart1"'),
    "an actuator of no joint": changed('<actuator joint="track2"', '<actuator joint="track9"'),
    "an actuator without a joint": changed('<actuator joint="track2"', "<actuator"),
    "an actuator of a floating joint": changed('<actuator joint="track2"', '<actuator joint="platform_pose"'),
    "a fixed joint as an actuator": changed('name="track1" type="prismatic"', 'name="track1" type="fixed"'),
    "an actuator left out": changed('<actuator joint="track2" site="cart2"/>', ""),
    "an axis of no length": changed("0.99778069049237 -0.06636337147432 -0.005440276383669", "0 0 0"),
    "an unknown link in a loop": changed('<link2 link="cart1"', '<link2 link="cart9"'),
    "a joint in place of a link in a loop": changed('<link2 link="cart1"', '<link2 link="track1"'),
    "a loop with one end": without('<link2 link="cart1"[^>]*>'),
    "a loop without a name": changed('<loop_joint name="ball1"', "<loop_joint"),
    "a loop of another type": changed('name="ball1" type="spherical"', 'name="ball1" type="revolute"'),
    "a loop's place in words": changed('xyz="0 0 2.04422"', 'xyz="0 0 long"'),
    "a loop's place in two numbers": changed('xyz="0 0 2.04422"', 'xyz="0 2.04422"'),
    "a loop's place nowhere": changed('xyz="0 0 2.04422"', 'xyz="0 0 nan"'),
    "a loop left out": without('<loop_joint name="ball1".*?</loop_joint>'),
    "an unknown platform": changed('<platform link="platform" tcp="tcp"/>', '<platform link="plate"/>'),
    "an unknown TCP": changed('tcp="tcp"', 'tcp="tip"'),
    "a rod of no loop": changed('loop="ball2a"', 'loop="ball9"'),
    "a rod of another's loop": changed('<rod link="link2a" loop="ball2a"', '<rod link="link2a" loop="ball2b"'),
    "a rod left out": changed('<rod link="link2a" loop="ball2a" site="link2a"/>', ""),
    "a rod twice": changed('<rod link="link2a" loop="ball2a" site="link2a"/>', '<rod link="link1" loop="ball1" site="x"/>'),
    "two rods of one site": changed('loop="ball2a" site="link2a"', 'loop="ball2a" site="link1"'),
    "a rod that hangs on no platform": re.sub('"platform"(/>\\s*<child link="link1_cross")', r'"base"\1', GANTRY),
    "a rod whose joints don't meet": re.sub(
        r'(<child link="link1"/>\s*<origin xyz=)"0 0 0"', r'\1"0 0.001 0"', GANTRY
    ),
    "a rod between two platforms": changed('<link2 link="cart1"', '<link2 link="link2a"'),
    "two home commands": changed('<home q="0 0 0"', '<home q="0 0"'),
    "home commands in words": changed('<home q="0 0 0"', '<home q="0 0 zero"'),
    "a home without a place": re.sub('tcp_xyz="[^"]*"', "", GANTRY),
    "a home with half a place": re.sub('tcp_xyz="[^"]*"', 'tcp_xyz="1 2"', GANTRY),
    "a tolerance of nothing": changed('link_length="0.001"', 'link_length="0"'),
    "a negative tolerance": changed('link_length="0.001"', 'link_length="-0.001"'),
    "an infinite tolerance": changed('link_length="0.001"', 'link_length="inf"'),
    "a tolerance in words": changed('link_length="0.001"', 'link_length="tight"'),
    "gravity with commas": changed('<gravity xyz="0 0 -9.81"', '<gravity xyz="0,0,-9.81"'),
    "two links of one name": changed('<link name="tcp"/>', '<link name="tcp"/><link name="tcp"/>'),
    "two joints of one name": changed('<joint name="track2"', '<joint name="track1"'),
    "two parents": changed('<parent link="base"/><child link="cart2"/>', '<parent link="base"/><child link="cart1"/>'),
    "an unknown parent": changed('<parent link="base"/><child link="cart2"/>', '<parent link="floor"/><child link="cart2"/>'),
    "a joint of no known type": changed('name="track1" type="prismatic"', 'name="track1" type="magnetic"'),
    "a track without limits": changed('<limit lower="-0.65" upper="0.7" effort="5000" velocity="3"/>', ""),
    "a place that is not finite": changed('<origin xyz="-3.18514', '<origin xyz="nan'),
    "a mass in words": changed('<mass value="22"/>', '<mass value="heavy"/>'),
}  # fmt: skip


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("what", SPOILT)
def test_what_is_no_robot_is_refused_in_one_line_with_nothing_printed(what: str, refused: Refused) -> None:
    assert SPOILT[what] != GANTRY
    refused(SPOILT[what])


def with_a_slide(parent: str, text: str) -> str:
    """Add a fourth actuator, which slides along z on a link of rod 1."""
    slide = f'<link name="slide"/><joint name="slides" type="prismatic"><parent link="{parent}"/><child link="slide"/>'
    slide += '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    text = changed('<home q="0 0 0"', '<home q="0 0 0 0"', changed("</robot>", slide, text))
    return changed("<platform link", '<actuator joint="slides" site="slide"/><platform link', text)


def test_a_rod_with_a_joint_beyond_its_actuator_is_refused(refused: Refused) -> None:
    """A leg that bends behind its actuator is no rod."""
    bent = changed('<parent link="link1_cross"/><child link="link1"/>', '<parent link="slide"/><child link="link1"/>')
    assert "do not meet" in str(refused(with_a_slide("link1_cross", bent)))


def test_a_rod_with_two_actuators_is_refused_and_not_half_understood(refused: Refused) -> None:
    both = changed('<link1 link="link1" xyz', '<link1 link="slide" xyz')
    both = changed('<rod link="link1"', '<rod link="slide"', both)
    assert "changes its length" in str(refused(with_a_slide("link1", both)))


def test_a_robot_without_loops_needs_no_gtpin_element() -> None:
    robot = gtpin.Robot(RobotDescription.parse(ARM))
    assert robot.sites == ("second", "first")
    assert robot.tcp_frame == "c"
    np.testing.assert_array_equal(robot.revolute, [False, True])
    np.testing.assert_array_equal(robot.lower, [0.0, -np.inf])
    np.testing.assert_array_equal(robot.upper, [1.0, np.inf])


def test_any_link_may_be_taken_for_the_tcp_and_only_a_link() -> None:
    description = RobotDescription.parse(ARM)
    assert gtpin.home(gtpin.Robot(description, tcp="b")).moved_to([0.5, 1.0]).T[0] == pytest.approx(0.5)
    with pytest.raises(RobotError, match="link"):
        gtpin.Robot(description, tcp="first")
    with pytest.raises(RobotError, match="link"):
        gtpin.load_robot("gantry_tau", tcp="nowhere")


def renamed(new: dict[str, str]) -> str:
    text = GANTRY
    for old in new:
        text = re.sub(rf'(<joint name|actuator joint)="{old}"', rf'\1="@{old}"', text)
    for old, name in new.items():
        text = text.replace(f'"@{old}"', f'"{name}"')
    return text


def test_the_order_of_q_is_that_of_the_actuators_however_joints_are_called() -> None:
    usual = gtpin.load_robot("gantry_tau")
    other = gtpin.Robot(
        RobotDescription.parse(renamed({"track1": "zz", "track2": "mm", "track3": "aa", "platform_pose": "nn"}))
    )
    order = [int(other.model.getJointId(name)) for name in ("zz", "mm", "aa")]
    assert order == sorted(order, reverse=True)  # Pinocchio sorts them the other way round
    assert other.sites == ("cart1", "cart2", "cart3")
    for q in np.random.default_rng(1).uniform(usual.lower, usual.upper, (20, 3)):
        one, two = gtpin.home(usual).moved_to(q), gtpin.home(other).moved_to(q)
        np.testing.assert_array_equal(two.q, q)
        np.testing.assert_allclose(one.T, two.T, rtol=0, atol=1e-13)
        np.testing.assert_allclose(one.jacobian, two.jacobian, rtol=0, atol=1e-11)


def test_actuators_in_another_order_give_commands_in_that_order() -> None:
    one, two = '<actuator joint="track1" site="cart1"/>', '<actuator joint="track3" site="cart3"/>'
    text = GANTRY.replace(one, "@").replace(two, one).replace("@", two)
    other = gtpin.Robot(RobotDescription.parse(text))
    assert other.sites == ("cart3", "cart2", "cart1")
    q = np.array([0.1, -0.2, 0.3])
    usual = gtpin.home(gtpin.load_robot("gantry_tau")).moved_to(q)
    turned = gtpin.home(other).moved_to(q[::-1])
    np.testing.assert_allclose(turned.T, usual.T, rtol=0, atol=1e-13)
    np.testing.assert_allclose(turned.jacobian, usual.jacobian[:, ::-1], rtol=0, atol=1e-11)


def test_a_joint_and_its_link_may_have_one_name() -> None:
    robot = gtpin.Robot(RobotDescription.parse(renamed({"track1": "cart1", "link1_yaw": "link1"})))
    usual = gtpin.home(gtpin.load_robot("gantry_tau")).moved_to([0.1, 0.2, 0.3])
    np.testing.assert_allclose(gtpin.home(robot).moved_to([0.1, 0.2, 0.3]).T, usual.T, rtol=0, atol=1e-13)


def test_a_home_near_the_machines_leads_to_it() -> None:
    near = re.sub('tcp_xyz="[^"]*"', 'tcp_xyz="-1.28 -4.24 0.01"', GANTRY)
    there = gtpin.home(gtpin.Robot(RobotDescription.parse(near)))
    np.testing.assert_allclose(there.T, gtpin.home(gtpin.load_robot("gantry_tau")).T, rtol=0, atol=1e-12)


def test_gravity_of_the_urdf_is_the_models() -> None:
    robot = gtpin.Robot(RobotDescription.parse(changed('<gravity xyz="0 0 -9.81"/>', '<gravity xyz="1 2 -3"/>')))
    np.testing.assert_array_equal(robot.model.gravity.linear, [1, 2, -3])
    silent = gtpin.Robot(RobotDescription.parse(changed('<gravity xyz="0 0 -9.81"/>', "")))
    np.testing.assert_array_equal(silent.model.gravity.linear, [0, 0, -9.81])
    assert pin.computeTotalMass(silent.model) == pytest.approx(3 * 40 + 22 + 6 * 4.1)
