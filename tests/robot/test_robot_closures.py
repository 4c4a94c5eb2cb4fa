"""A robot of example-parallel-robots: a URDF without loops, and a YAML file that closes them."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from urdfs import crossing, joint, urdf

import gtpin
from gtpin.errors import RobotError
from gtpin.robot.description import RobotDescription

NEAR, FAR, BASE = 0.3, 0.4, 0.1
"""Lengths of the links of a five-bar, and half the distance of its drives, m."""
DRIVES = ("drive_left", "drive_right")
YAML = """# a five-bar
closed_loop: [['pin_A', 'pin_B']]
type: ['3D']
name_mot: ["drive_left", "drive_right"]
"""


def five_bar() -> str:
    """A five-bar in an upright plane; ``pin_A`` is a link, ``pin_B`` a fixed joint, both where the far links meet."""
    parts = []
    for side, sign, drive, end, bolt in (
        ("left", -1.0, -2.2, "pin_A", "mount"),
        ("right", 1.0, 2.2 - np.pi, "end", "pin_B"),
    ):
        far, turned = f"{side}_far", f"0 {-1.3758 * sign} 0"
        parts += [
            joint(f"drive_{side}", "base", side, f"{sign * BASE} 0 0", "0 -1 0", rpy=f"0 {drive} 0", limit=0.7),
            joint(f"elbow_{side}", side, far, f"{NEAR} 0 0", "0 -1 0", kind="continuous", rpy=turned),
            joint(bolt, far, end, f"{FAR} 0 0", kind="fixed"),
        ]
    return urdf("five", *parts)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "robot.urdf").write_text(five_bar(), encoding="utf-8")
    (tmp_path / "robot.yaml").write_text(YAML, encoding="utf-8")
    return tmp_path / "robot.yaml"


def test_its_loop_closes_where_two_circles_meet(file: Path) -> None:
    model = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(file, tcp="pin_A")))
    assert model.robot.sites == DRIVES
    q = np.random.default_rng(3).uniform(-0.3, 0.3, (10, 2))
    zero = np.array([2.2, np.pi - 2.2])  # a turn about -y lifts x towards z
    elbows = np.array([[-BASE, 0.0], [BASE, 0.0]]) + NEAR * np.stack([np.cos(zero + q), np.sin(zero + q)], axis=2)
    expected = crossing(elbows[:, 0], FAR, elbows[:, 1], FAR)
    np.testing.assert_allclose(model.predict(q).T[:, [0, 2]], expected, atol=1e-9)


def test_a_model_of_it_needs_no_yaml(file: Path, tmp_path: Path) -> None:
    model = gtpin.read_model(file)
    gtpin.write_model(model, tmp_path / "model")
    q = np.array([[0.1, -0.2]])
    np.testing.assert_array_equal(gtpin.read_model(tmp_path / "model").predict(q).T, model.predict(q).T)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            "'3D'",
            "'4d'",
            r"row 3, column type: the loop of pin_A and pin_B is closed by '4d'; write one of 3d, 6d",
        ),
        ("['3D']", "['3d', '3d']", "2 types for 1 loops"),
        ("'pin_B'", "'lost'", "the URDF has no link and no joint 'lost'"),
        ("[['pin_A', 'pin_B']]", "['pin_A', 'pin_B']", "row 2, column closed_loop: closed_loop is no list of pairs"),
        ('"drive_right"', '"lost"', "lost"),
        ('"drive_right"', "7", "name_mot is no list of names"),
        ("type: ['3D']\n", "", "the key type is missing"),
        ("type: ['3D']\n", "type:\n  - 3D\n", "row 3: no key with a list"),
        ("# a five-bar", "joint_name: ['elbow_left']", "0 types for 1 joints"),
        ("# a five-bar", "type: ['3D']", "row 3: no key with a list"),
        ("# a five-bar", "x: " + "[" * 5000, "no key with a list"),
        ("# a five-bar", "x: __import__('os')", "no key with a list"),
    ],
)
def test_what_is_no_such_file_is_refused_with_its_place(file: Path, old: str, new: str, told: str) -> None:
    assert old in YAML
    file.write_text(YAML.replace(old, new), encoding="utf-8")
    with pytest.raises(RobotError, match=told) as refused:
        gtpin.load_robot(file)
    assert len(str(refused.value).splitlines()) == 1


def test_lists_over_several_lines_and_joints_of_other_types_are_read(file: Path) -> None:
    """As battobot_6d and digit_like_2legs of example-parallel-robots have them."""
    text = """closed_loop:
  [
    # a comment
    ["pin_A", "pin_B"],
  ]
type: ["3d"]
name_mot:
  ["drive_left", "drive_right"]

joint_name: ["elbow_left", "elbow_right", "mount"]
joint_type: ["UJOINT_YX", "SPHERICAL", "FIXED"]
"""
    file.write_text(text, encoding="utf-8")
    described = RobotDescription.read(file)
    moving = ("drive_left", "elbow_left", "drive_right", "elbow_right")
    assert set(described.tree.moving) == {*moving, "elbow_left_2", "elbow_right_2", "elbow_right_3"}
    q = pin.neutral(model := pin.buildModelFromXML(described.xml))
    for name, index, axis in (
        ("elbow_left", 1, (0, 1, 0)),
        ("elbow_left_2", 2, (1, 0, 0)),
        ("elbow_right_3", 6, (0, 0, 1)),
    ):
        data = model.createData()
        pin.computeJointJacobians(model, data, q)
        column = pin.getJointJacobian(model, data, model.getJointId(name), pin.LOCAL)[
            3:, model.idx_vs[model.getJointId(name)]
        ]
        np.testing.assert_allclose(column, axis, atol=1e-12, err_msg=f"{name} {index}")
    file.write_text(text.replace("UJOINT_YX", "PLANAR"), encoding="utf-8")
    with pytest.raises(RobotError, match="row 11, column joint_type: joints of type PLANAR are not read"):
        RobotDescription.read(file)


def test_files_that_do_not_belong_together_are_refused(file: Path, tmp_path: Path) -> None:
    urdf = tmp_path / "robot.urdf"
    loop = '<loop_joint name="bolt" type="spherical"><link1 link="left_far"/><link2 link="right_far"/></loop_joint>'
    urdf.write_text(five_bar().replace("</robot>", f"{loop}</robot>"), encoding="utf-8")
    with pytest.raises(RobotError, match="closed_loop is not what the URDF's <loop_joint>s are: bolt"):
        gtpin.load_robot(file)
    urdf.write_text(
        five_bar().replace("</robot>", '<gtpin><actuator joint="drive_left"/></gtpin></robot>'), encoding="utf-8"
    )
    with pytest.raises(RobotError, match="the URDF's driven joints are drive_left"):
        gtpin.load_robot(file)
    urdf.unlink()
    with pytest.raises(RobotError, match=r"robot\.urdf: the file is missing; put the URDF of robot\.yaml beside it"):
        gtpin.load_robot(file)
