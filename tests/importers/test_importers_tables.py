"""Lists of points, and poses of ROS: what the user names, and how commands are found for them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from printed import POINTS, ROS, ROS2, Write
from typer.testing import CliRunner

import gtpin
from gtpin.data import Commands
from gtpin.errors import DatasetError, GtpinWarning
from gtpin.extras.importers.commands import import_app
from gtpin.extras.importers.points import read_commands, read_points
from gtpin.extras.importers.ros_poses import read_ros_poses

NAMES = ["-", "-", "pose", "x", "y", "z"]


def commands(pose: list[str], **covariates: list[float]) -> Commands:
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (len(pose), 6))
    return Commands(np.array(pose, dtype=object), q, {name: np.array(v) for name, v in covariates.items()})


def test_points_have_the_commands_of_the_pose_of_their_name(write: Write) -> None:
    given = commands(["p2", "p1", "p3"])
    file = write("points.txt", POINTS)
    dataset = read_points(file, "ur5", NAMES, "space", "mm", commands=given, match="pose")
    assert list(dataset.pose) == ["p1", "p2", "p1"]
    np.testing.assert_array_equal(dataset.q, given.q[[1, 0, 1]])
    np.testing.assert_allclose(dataset.position[0], [1.2034512, -0.87712, 0.4550031], rtol=1e-12)
    assert (dataset.instrument.frame, dataset.instrument.target) == ("free", "free")


def test_joint_values_are_read_as_a_controller_logs_them(write: Write) -> None:
    q = np.radians([[90, 0, -45.5, 1, 2, 180], [10, 20, 30, 40, 50, 60]])
    degrees = [",".join(f"{v:.4f}" for v in row) for row in np.degrees(q)]
    logged = f"Point,Base,Shoulder,Elbow,Wrist 1,Wrist 2,Wrist 3\np1,{degrees[0]}\np2,{degrees[1]}\n"
    own = f"pose,q1,q2,q3,q4,q5,q6\np1,{degrees[0]}\np2,{degrees[1]}\n"
    unnamed = "\n".join(line.replace(",", ";").replace(".", ",") for line in degrees)
    for text, comma in ((logged, False), (own, False), (f"{unnamed}\n", True)):
        found = read_commands(write("joints.csv", text), "ur5", "mm", angle="deg", decimal_comma=comma)
        np.testing.assert_allclose(found.q, q)
        assert list(found.pose) == (["1", "2"] if comma else ["p1", "p2"])
    for text in (logged, own):
        with pytest.raises(DatasetError, match="--angle deg"):
            read_commands(write("joints.csv", text), "ur5", "mm")
    assert read_commands(write("joints.csv", own), "ur5", "mm", angle="rad").q.max() == 180.0
    with pytest.raises(DatasetError, match="has 7 columns, and linear_delta has 3 actuators"):
        read_commands(write("joints.csv", logged), "linear_delta", "mm", angle="deg")


def test_a_line_of_names_before_the_first_row_is_no_row(write: Write) -> None:
    file = write("points.csv", "Point,X [mm],Y [mm],Z [mm]\np1,1.0,2.0,3.0\n")
    dataset = read_points(file, "ur5", ["pose", "x", "y", "z"], "comma", "mm", commands=commands(["p1"]), match="pose")
    np.testing.assert_allclose(dataset.position, [[1e-3, 2e-3, 3e-3]])
    assert list(dataset.row) == [2]


def test_rows_have_the_commands_of_their_order_if_there_are_as_many(write: Write) -> None:
    file = write("points.txt", POINTS)
    given = Commands(np.array(["a", "b", "a"], dtype=object), commands(["a", "b", "c"]).q[[0, 1, 0]])
    dataset = read_points(file, "ur5", NAMES, "space", "inch", commands=given, match="row")
    np.testing.assert_array_equal(dataset.q, given.q)
    np.testing.assert_allclose(dataset.position[1, 2], 401.25 * 0.0254)
    with pytest.raises(DatasetError, match="3 rows, and 2 of commands"):
        read_points(file, "ur5", NAMES, "space", "mm", commands=commands(["a", "b"]), match="row")


def test_decimal_commas_semicolons_and_degrees_are_read_as_they_are_named(write: Write) -> None:
    text = "x;y;z;T;j1;j2;j3;j4;j5;j6\n1,5;-2,25;3;20,5;90;0;-45;1;2;180\n"
    names = ["x", "y", "z", "temp_frame", *(f"q{i}" for i in range(1, 7))]
    dataset = read_points(
        write("points.csv", text), "ur5", names, "semicolon", "m", angle="deg", header=1, decimal_comma=True
    )
    np.testing.assert_allclose(dataset.position, [[1.5, -2.25, 3.0]])
    np.testing.assert_allclose(dataset.q, np.radians([[90, 0, -45, 1, 2, 180]]))
    np.testing.assert_allclose(dataset.covariates["temp_frame"], [20.5])


@pytest.mark.parametrize("header", ["- - pose x y z", "Collection Group Name X [mm] Y [mm] Z [mm]", "Points"])
def test_a_table_with_a_header_is_read_as_without_it(write: Write, header: str) -> None:
    given: dict[str, Any] = {"commands": commands(["p1", "p2"]), "match": "pose"}
    without = read_points(write("points.txt", POINTS), "ur5", NAMES, "space", "mm", **given)
    headed = read_points(write("headed.txt", f"{header}\n{POINTS}"), "ur5", NAMES, "space", "mm", **given)
    np.testing.assert_array_equal(headed.position, without.position)
    assert list(headed.pose) == list(without.pose)


def test_a_header_with_the_names_in_another_order_is_refused(write: Write) -> None:
    file = write("points.csv", "Point,Y [mm],X [mm],Z [mm]\np1,1.0,2.0,3.0\n")
    with pytest.raises(DatasetError, match="column 2 is 'y' here, and 'x' in --columns"):
        read_points(file, "ur5", NAMES[2:], "comma", "mm", commands=commands(["p1"]), match="pose")


def test_a_header_in_which_two_columns_have_a_name_says_nothing_of_their_order(write: Write) -> None:
    text = "Point,X,Y,Z,W,X,Y,Z\np1,0.0,0.0,0.0,1.0,1.0,2.0,3.0\n"
    names = ["pose", "qx", "qy", "qz", "qw", "x", "y", "z"]
    found = read_points(write("points.csv", text), "ur5", names, "comma", "mm", commands=commands(["p1"]), match="pose")
    np.testing.assert_allclose(found.position, [[1e-3, 2e-3, 3e-3]])


@pytest.mark.parametrize("blank", ["p2,,,", "p2,,"])
def test_a_row_without_a_position_is_left_out_with_a_warning(write: Write, blank: str) -> None:
    file = write("points.csv", f"p1,1.0,2.0,3.0\n{blank}\np3,4.0,5.0,6.0\n")
    given: dict[str, Any] = {"commands": commands(["p1", "p2", "p3"]), "match": "pose"}
    with pytest.warns(GtpinWarning, match="1 rows have no position .the first is row 2"):
        found = read_points(file, "ur5", NAMES[2:], "comma", "mm", **given)
    assert list(found.pose) == ["p1", "p3"]


@pytest.mark.parametrize("own", [True, False])
def test_degrees_that_are_read_as_rad_are_refused_when_the_list_is_read(write: Write, own: bool) -> None:
    given = Commands(np.array(["p1", "p2"], dtype=object), np.array([[90.0, -80, 100, 45, 60, 170]] * 2))
    row = ",".join(map(str, given.q[0]))
    text, names = (f"1,2,3,{row}\n", ["x", "y", "z", *(f"q{i}" for i in range(1, 7))]) if own else (POINTS, NAMES)
    with pytest.raises(DatasetError, match="looks like degrees"):
        read_points(
            write("points.txt", text), "ur5", names, "comma" if own else "space", "mm", angle="rad" if own else None,
            commands=None if own else given, match=None if own else "pose",
        )  # fmt: skip


def test_lengths_among_the_commands_have_the_unit_of_lengths(write: Write) -> None:
    robot = gtpin.load_robot("linear_delta")
    assert not robot.revolute.any()
    text = "1,2,3,100,-50,25\n"
    dataset = read_points(
        write("points.csv", text), "linear_delta", ["x", "y", "z", "q1", "q2", "q3"], "comma", "mm", tcp=None
    )
    np.testing.assert_allclose(dataset.q, [[0.1, -0.05, 0.025]])


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"columns": ["-", "pose", "x", "y", "z"]}, "row 2: the row has 6 columns, and 5 are named"),
        ({"columns": ["-", "-", "pose", "x", "y", "y"]}, "named twice"),
        ({"columns": ["-", "-", "pose", "x", "y", "-"]}, "no column is named z"),
        ({"columns": ["-", "-", "qw", "x", "y", "z"]}, "no column is named qx"),
        ({"columns": ["-", "-", "q2", "x", "y", "z"], "commands": None}, "no column is named q1"),
        ({"columns": ["-", "pose", "-", "x", "y", "z"]}, "no command of pose Poses"),
        ({"unit": "km"}, "unit 'km'"),
        ({"match": None}, "which command"),
        ({"match": "time"}, "no time"),
        ({"commands": None}, "there are no commands"),
        ({"header": 9}, "there are no rows"),
        ({"separator": "comma"}, "the row has 1 columns"),
        ({"separator": "comma", "decimal_comma": True}, "commas between columns and in numbers"),
    ],
)
def test_what_is_not_said_or_does_not_fit_is_refused(write: Write, changed: dict[str, Any], told: str) -> None:
    given: dict[str, Any] = {
        "columns": NAMES,
        "separator": "space",
        "unit": "mm",
        "commands": commands(["p1", "p2"]),
        "match": "pose",
        **changed,
    }
    with pytest.raises(DatasetError, match=told):
        read_points(write("points.txt", POINTS), "ur5", **given)


# A turn of 90 degrees about x, then of 90 degrees about the fixed z: the matrix maps x to y, y to z and z to x.
CYCLIC = [0.5, 0.5, 0.5, 0.5]
TURNED = {"xyz": "90 0 90", "ZYX": "90 0 90", "zyx": "0 90 90", "ZYZ": "0 90 90", "vector": "69.28203230275509 " * 3}


@pytest.mark.parametrize("rotation", TURNED)
def test_angles_and_rotation_vectors_are_read_by_their_convention(write: Write, rotation: str) -> None:
    names = ["pose", "x", "y", "z", "rx", "ry", "rz"]
    file = write("points.txt", f"p1 1 2 3 {TURNED[rotation]}\n")
    given: dict[str, Any] = {"commands": commands(["p1"]), "match": "pose"}
    found = read_points(file, "ur5", names, "space", "mm", angle="deg", rotations=rotation, **given)
    np.testing.assert_allclose(found.orientation, [CYCLIC], atol=1e-9)
    with pytest.raises(DatasetError, match="it is not said what rx, ry and rz are; add --angle"):
        read_points(file, "ur5", names, "space", "mm", angle="deg", **given)


C15, S15 = float(np.cos(np.pi / 12.0)), float(np.sin(np.pi / 12.0))
# How each maker writes a turn of 30 degrees about one axis: the line, and the scalar and the axis of the turn.
MAKERS = {
    "kuka": ("p1,1000,2000,3000,30,0,0", "z"),
    "fanuc": ("p1,1000,2000,3000,30,0,0", "x"),
    "abb": (f"p1,1000,2000,3000,{C15!r},0,{S15!r},0", "y"),
    "ur": (f"p1,1,2,3,0,{np.pi / 6.0!r},0", "y"),
}


@pytest.mark.parametrize("maker", MAKERS)
def test_poses_are_read_as_their_maker_writes_them(write: Write, tmp_path: Path, maker: str) -> None:
    line, axis = MAKERS[maker]
    file, joints = write("poses.csv", line + "\n"), write("joints.csv", "pose,q1,q2,q3,q4,q5,q6\np1,0,-1,1,0,1,0\n")
    given = ["--preset", maker, "--robot", "ur5", "--commands", str(joints), "--match", "pose"]
    done = CliRunner().invoke(import_app, ["points", str(file), *given, "-o", str(tmp_path / maker)])
    assert done.exit_code == 0, done.output
    found = gtpin.Dataset.read(tmp_path / maker)
    np.testing.assert_allclose(found.position, [[1.0, 2.0, 3.0]])
    turned = [C15, *(S15 if one == axis else 0.0 for one in "xyz")]
    np.testing.assert_allclose(found.orientation, [turned], atol=1e-9)


def test_what_a_file_does_not_say_of_itself_is_asked_for(write: Write, tmp_path: Path) -> None:
    given = ["points", str(write("poses.csv", "p1,1,2,3\n")), "--robot", "ur5", "-o", str(tmp_path / "a")]
    done = CliRunner().invoke(import_app, [*given, "--columns", "pose,x,y,z", "--separator", "comma"])
    assert isinstance(done.exception, DatasetError)
    assert "add --unit, or --preset" in str(done.exception)


def test_the_unit_of_angles_is_asked_for(write: Write) -> None:
    names = ["x", "y", "z", *(f"q{i}" for i in range(1, 7))]
    file = write("points.txt", "1 2 3 1 1 1 1 1 1\n")
    with pytest.raises(DatasetError, match=r"unit of their commands is not given; add --angle rad or --angle deg"):
        read_points(file, "ur5", names, "space", "mm")
    with pytest.raises(DatasetError, match="5 columns of commands for the 6"):
        read_points(write("short.txt", "1 2 3 1 1 1 1 1\n"), "ur5", names[:-1], "space", "mm", angle="rad")


def test_poses_of_a_topic_have_the_command_nearest_in_time(write: Write) -> None:
    given = commands(["a", "b"], time=[175.45, 175.58])
    dataset = read_ros_poses(write("tag.csv", ROS), "ur5", given, "time", within=0.05)
    assert list(dataset.pose) == ["a", "b", "b"]
    np.testing.assert_allclose(dataset.position[2], [0.43, -0.07, 0.34])
    np.testing.assert_allclose(dataset.covariates["time"], [0.0, 0.12, 0.174], atol=1e-9)
    with pytest.warns(GtpinWarning, match="1 of 3 rows are farther than 0.03 s from a command"):
        assert list(read_ros_poses(write("tag.csv", ROS), "ur5", given, "time", within=0.03).pose) == ["a", "b"]
    late = commands(["a", "b"], time=[275.45, 275.58])
    with pytest.raises(DatasetError, match=r"row 2, column time: 3 of 3 rows .* one clock .* is 100\.\d+ s"):
        read_ros_poses(write("tag.csv", ROS), "ur5", late, "time", within=0.03)
    with pytest.raises(DatasetError, match="longest time"):
        read_ros_poses(write("tag.csv", ROS), "ur5", given, "time")


def test_quaternions_are_ordered_by_the_names_of_their_columns(write: Write) -> None:
    dataset = read_ros_poses(write("tag.csv", ROS), "ur5", commands(["a", "b", "c"]), "row")
    expected = [[0.8, 0.0, 0.6, 0.0], [0.8, 0.6, 0.0, 0.0], [0.8, 0.0, 0.0, 0.6]]
    np.testing.assert_allclose(dataset.orientation, expected, atol=1e-12)


def test_of_several_poses_in_a_message_the_one_that_is_meant_has_to_be_named(write: Write) -> None:
    header, *rows = ROS.splitlines()
    pose = header.split(",")[4:]
    both = header + "," + ",".join(name.replace("field.pose", "field.detections1.pose.pose.pose") for name in pose)
    text = "\n".join([both, *(f"{row},1.0,2.0,3.0,0.0,0.0,0.0,1.0" for row in rows)])
    given = commands(["a", "b", "c"])
    with pytest.raises(DatasetError, match=r"2 columns end in position\.x"):
        read_ros_poses(write("tags.csv", text), "ur5", given, "row")
    prefix = "field.detections1.pose.pose.pose"
    dataset = read_ros_poses(write("tags.csv", text), "ur5", given, "row", prefix=prefix)
    np.testing.assert_allclose(dataset.position, np.tile([1.0, 2.0, 3.0], (3, 1)))


@pytest.mark.parametrize(
    ("child", "after"),
    [("", 0), (",tool", 0), ("", 36), (",tool", 36 + 6 + 36)],
    ids=["pose", "tf", "covariance", "odom"],
)
def test_messages_of_ros_2_without_a_header_are_the_same_poses(write: Write, child: str, after: int) -> None:
    given = commands(["a", "b"], time=[175.45, 175.58])
    text = "".join(f"{line}{',0.5' * after}\n" for line in ROS2.replace(",tag", f",tag{child}").splitlines())
    one = read_ros_poses(write("ros2.csv", text), "ur5", given, "time", within=0.05)
    other = read_ros_poses(write("ros1.csv", ROS), "ur5", given, "time", within=0.05)
    np.testing.assert_array_equal(one.position, other.position)
    np.testing.assert_array_equal(one.orientation, other.orientation)
    np.testing.assert_allclose(one.covariates["time"], other.covariates["time"], atol=1e-9)
    assert list(one.row) == [1, 2, 3]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1,2,3\n", "as ros2 topic echo --csv writes it, and 3 columns"),
        (ROS[ROS.index("\n") + 1 :], "'175447000000' is no sec of a stamp"),
        (ROS2.replace("567000000", "5670000000"), r"row 2, column nanosec: '5670000000' is no nanosec"),
        (ROS2.replace("tag", "7"), "the frame is '7', a number"),
        (ROS2 + "175,6,tag,1.0\n", "row 4: the row has 4 cells, the first row 10"),
        (ROS2.replace("0.33", "up"), "row 2, column z: 'up' is not a number"),
    ],
)
def test_what_is_no_message_of_ros_2_is_refused(write: Write, text: str, told: str) -> None:
    with pytest.raises(DatasetError, match=told):
        read_ros_poses(write("ros2.csv", text), "ur5", commands(["a", "b", "c"]), "row")


def test_a_topic_without_poses_is_refused(write: Write) -> None:
    with pytest.raises(DatasetError, match=r"there is no column position\.x"):
        read_ros_poses(write("imu.csv", "%time,field.data\n1,2\n"), "ur5", commands(["a"]), "row")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (POINTS.replace(".", ","), "decimal-comma"),
        ("SpatialAnalyzer version 3 X Y Z\n" + POINTS, "header"),
        (POINTS.replace("-870.5600", "lost"), "correct the row"),
    ],
)
def test_what_can_t_be_read_has_a_hint_of_the_option_that_would_help(write: Write, text: str, told: str) -> None:
    with pytest.raises(DatasetError) as refused:
        read_points(write("points.txt", text), "ur5", NAMES, "space", "mm", commands=commands(["p1"]), match="pose")
    assert told in str(refused.value.hint)
