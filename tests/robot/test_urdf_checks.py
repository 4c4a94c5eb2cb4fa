"""A URDF that can be parsed, but is not what its author means: said by name, in one line."""

from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.errors import GtpinError, GtpinWarning, ModelError, RobotError

NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
ARM = f"""<robot name="arm" {NAMESPACE}><link name="base"/><link name="l1"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="l2"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 0.3" rpy="0 0 1.5"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="j2" type="prismatic"><parent link="l1"/><child link="l2"/><origin xyz="0.2 0 0.3"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def loaded(folder: Path, text: str) -> gtpin.Robot:
    (folder / "arm.urdf").write_text(text, encoding="utf-8")
    return gtpin.load_robot(folder / "arm.urdf")


def tip(robot: gtpin.Robot) -> np.ndarray:
    return gtpin.home(robot).moved_to([0.3, 0.1]).T


@pytest.mark.parametrize(
    "change",
    [
        ('<link name="base"/>', '<link name="base"/><xacro:include filename="rest.xacro"/>'),
        ('<link name="l2"/>', '<link name="l2"/><xacro:tool parent="l2"/>'),
        ('<link name="base"/>', '<link name="base"/><gazebo><xacro:if value="1"/></gazebo>'),
        ('xyz="0 0 0.3"', 'xyz="0 0 ${height}"'),
        ('name="l2"/>', 'name="$(arg prefix)l2"/>'),
        ('<link name="l2"/>', '<link name="l2" xacro:this="1"/>'),
        (f" {NAMESPACE}><link", "><xacro:tool/><link"),  # a prefix that is not declared
    ],
)
def test_an_unexpanded_xacro_file_is_refused(tmp_path: Path, change: tuple[str, str]) -> None:
    assert ARM.replace(*change) != ARM
    with pytest.raises(RobotError, match=r"this is a xacro file; expand it first \(xacro FILE > robot\.urdf\)$"):
        loaded(tmp_path, ARM.replace(*change))


def test_an_expanded_xacro_file_is_read(tmp_path: Path) -> None:
    """xacro keeps the namespace. What plugins of Gazebo have in braces is not xacro's."""
    with_plugin = ARM.replace("</robot>", '<gazebo><plugin topic="${robot}/state"/></gazebo></robot>')
    assert loaded(tmp_path, with_plugin).n_actuators == 2


@pytest.mark.parametrize("before", ["\n", "  ", "\n\n\t ", "\ufeff"])
def test_blank_lines_before_the_declaration_do_not_matter(tmp_path: Path, before: str) -> None:
    text = before + '<?xml version="1.0"?>\n' + ARM
    robot = loaded(tmp_path, text)
    np.testing.assert_array_equal(tip(robot), tip(loaded(tmp_path, ARM)))
    gtpin.write_model(gtpin.Model(gtpin.Geometry.nominal(robot)), tmp_path / "model")
    assert gtpin.read_model(tmp_path / "model").robot.n_actuators == 2
    with pytest.raises(RobotError, match=rf"row {text.count(chr(10)) + 1}: not well-formed"):
        loaded(tmp_path, text.replace("</robot>", "</robots>"))


def test_angles_in_degrees_are_told_with_the_joint(tmp_path: Path) -> None:
    with pytest.warns(GtpinWarning, match='joint j1: rpy="0 0 90" is more than a full turn'):
        loaded(tmp_path, ARM.replace("0 0 1.5", "0 0 90"))
    loaded(tmp_path, ARM.replace("0 0 1.5", "0 0 -6.28"))  # a warning would be an error here


@pytest.mark.parametrize("mass", ["-1", "nan", "inf", "-1e-300"])
def test_a_mass_that_can_not_be_is_refused_with_the_link(tmp_path: Path, mass: str) -> None:
    with pytest.raises(RobotError, match="the mass of link l1 is"):
        loaded(tmp_path, ARM.replace('value="2"', f'value="{mass}"'))


def test_a_mass_that_no_link_has_is_left_out(tmp_path: Path) -> None:
    far = ARM.replace('<mass value="2"', '<origin xyz="0 500 0"/><mass value="2"')
    with pytest.warns(GtpinWarning, match="carries is 500 m away: the mass is left out"):
        loaded(tmp_path, far)


def test_a_link_with_two_parents_is_refused_with_both_joints(tmp_path: Path) -> None:
    second = '<joint name="j3" type="fixed"><parent link="base"/><child link="l2"/></joint></robot>'
    with pytest.raises(RobotError, match="link l2 has two parents, j2 and j3; "):
        loaded(tmp_path, ARM.replace("</robot>", second))


@pytest.mark.parametrize("numbers", ['multiplier="1e308"', 'multiplier="-1e7"', 'offset="1e9"'])
def test_a_follower_that_moves_absurdly_far_is_refused_with_the_joint(tmp_path: Path, numbers: str) -> None:
    follower = ARM.replace(
        'velocity="1"/></joint></robot>', f'velocity="1"/><mimic joint="j1" {numbers}/></joint></robot>'
    )
    with pytest.raises(RobotError, match="<mimic> of joint j2"):
        loaded(tmp_path, follower)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_robot_of_absurd_size_is_refused_with_the_joint(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match=r"joint j2 is .*e\+199 m from the base"):
        loaded(tmp_path, ARM.replace("0.2 0 0.3", "1e200 0 0.3"))


@pytest.mark.parametrize(
    ("name", "parameter", "value", "said"),
    [
        ("gantry_tau", "length[2a]", 3.0, "the loops don't close at home; .* this value, 3"),
        ("gantry_tau", "track_direction[cart3].b", 1e9, "1e[+]09 rad"),
        ("arm", "placement[j2].rx", 1e9, "1e[+]09 rad"),
        ("arm", "placement[j2].x", 1e200, "1e[+]200 m"),
        ("arm", "placement[j2].x", -11.0, "-11 m, where 0 is nominal"),
    ],
)
def test_a_value_that_no_machine_has_is_refused_with_the_parameter(
    tmp_path: Path, name: str, parameter: str, value: float, said: str
) -> None:
    robot = loaded(tmp_path, ARM) if name == "arm" else gtpin.load_robot(name)
    gtpin.write_model(gtpin.Model(gtpin.Geometry.nominal(robot)), tmp_path / "model")
    file = tmp_path / "model" / "model.json"
    lines = file.read_text(encoding="utf-8").splitlines()
    (row,) = (i for i, line in enumerate(lines) if f'"{parameter}":' in line and i < lines.index(' "tolerance": {'))
    lines[row] = f'  "{parameter}": {value!r}{"," * lines[row].endswith(",")}'
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(ModelError, match=said) as caught:
        gtpin.read_model(tmp_path / "model")
    assert f"column parameters.{parameter}" in str(caught.value)


@pytest.mark.parametrize("sign", ["\x1b[31m", "\x9b31m", "\x7f", "\u202e"])
def test_control_characters_in_names_reach_no_terminal(tmp_path: Path, sign: str) -> None:
    """Files that hold them are refused, and errors and warnings show them as escapes."""
    gtpin.write_model(gtpin.read_model("gantry_tau"), tmp_path / "model")
    file = tmp_path / "model" / "model.json"
    escaped = "".join(f"\\u{ord(c):04x}" for c in sign)
    file.write_text(file.read_text(encoding="utf-8").replace('"gantry_tau"', f'"gantry{escaped}"'), encoding="utf-8")
    toml = tmp_path / "dataset.toml"
    toml.write_text(
        f'schema = "gtpin-dataset/1"\nrobot = "gantry{escaped}"\n[instrument]\nframe = "robot"\n', encoding="utf-8"
    )
    reads = [lambda: gtpin.read_model(tmp_path / "model"), lambda: gtpin.Dataset.read(tmp_path)]
    if sign[0] != "\x1b":  # XML has no such character
        reads.append(lambda: loaded(tmp_path, ARM.replace('"l2"', f'"l2{sign}"')))
    for read in reads:
        with pytest.raises(GtpinError, match="has a control character") as caught:
            read()
        assert sign[0] not in str(caught.value)
    assert sign[0] not in str(GtpinError(f"a{sign}b"))
    with pytest.warns(GtpinWarning) as warned:
        gtpin.errors.warn(f"a{sign}b")
    assert sign[0] not in str(warned[0].message)
