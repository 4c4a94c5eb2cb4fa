"""Any robot: by the names of example-robot-data, with any of its joints commanded, and with a TCP that it need not name."""

import json
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from urdfs import joint, robot_of

import gtpin
from gtpin.errors import RobotError
from gtpin.robot.description import RobotDescription
from gtpin.robot.library import FILES, example_names, example_path, load_robot
from gtpin.robot.resting import with_actuators

SEVEN = [f"panda_joint{i}" for i in range(1, 8)]
JOINTS = {"ur3": 6, "ur5": 6, "ur10": 6, "panda": 8, "kinova": 6, "xarm7": 7, "so100": 6, "z1": 7, "talos_left_arm": 7}
JOINTS |= {"allegro_left_hand": 16}


def plain(name: str) -> tuple[pin.Model, pin.Data]:
    """The same file as Pinocchio alone loads it, mimic joints included."""
    model = pin.buildModelFromXML(example_path(name).read_text(encoding="utf-8"), mimic=True)
    return model, model.createData()


@pytest.mark.filterwarnings("ignore:the TCP of .* does not move")
@pytest.mark.parametrize("name", JOINTS)
def test_arms_are_found_by_name_and_move_as_pinocchio_moves_them(name: str) -> None:
    robot = load_robot(name)
    assert robot.n_actuators == JOINTS[name]
    model, data = plain(name)
    frame = model.getFrameId(robot.tcp_frame, pin.FrameType.BODY)
    for q in np.random.default_rng(1).uniform(-2.0, 2.0, (5, robot.n_actuators)):
        configuration = pin.neutral(model)
        for actuator, angle in zip(robot.actuators, q, strict=True):
            joint = model.getJointId(actuator.joint)
            both = [np.cos(angle), np.sin(angle)] if model.nqs[joint] == 2 else [angle]
            configuration[model.idx_qs[joint] : model.idx_qs[joint] + len(both)] = both
        pin.framesForwardKinematics(model, data, configuration)
        posture = gtpin.home(robot).moved_to(q)
        np.testing.assert_allclose(posture.T, data.oMf[frame].translation, rtol=0, atol=1e-12)
        np.testing.assert_allclose(posture.R, data.oMf[frame].rotation, rtol=0, atol=1e-12)
        if not robot.followers:
            J = pin.computeFrameJacobian(model, data, configuration, frame, pin.LOCAL_WORLD_ALIGNED)
            expected = J[:, [model.idx_vs[model.getJointId(name)] for name in robot.sites]]
            np.testing.assert_allclose(posture.jacobian, expected, rtol=0, atol=1e-12)


def test_every_file_of_the_table_is_there() -> None:
    assert set(example_names()) == set(FILES)


def test_what_gtpin_ships_comes_before_the_examples() -> None:
    assert not set(gtpin.robot_names()) & set(example_names())  # nothing is hidden today
    assert load_robot("gantry_tau").rods


def test_a_name_that_can_not_be_loaded_says_why() -> None:
    with pytest.raises(RobotError, match="cassie of example-robot-data is an SDF file"):
        load_robot("cassie")
    with pytest.raises(RobotError, match="did you mean ur5"):
        load_robot("ur55")


@pytest.mark.slow
def test_the_list_of_robots_says_joints_and_sources() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "gtpin", "robots", "--json"], capture_output=True, text=True, check=True
    )
    found = {robot["name"]: robot for robot in json.loads(done.stdout)}
    assert set(found) == {*gtpin.robot_names(), *example_names()}
    assert found["ur5"]["source"] == "example-robot-data"
    assert found["ur5"]["joints"] == list(load_robot("ur5").sites)
    assert found["gantry_tau"]["source"] == "gtpin"
    assert not found["cassie"]["loads"]
    assert "SDF" in found["cassie"]["reason"]
    table = subprocess.run([sys.executable, "-m", "gtpin", "robots"], capture_output=True, text=True, check=True).stdout
    assert next(line for line in table.splitlines() if line.startswith("panda ")).split() == [
        "panda",
        "8",
        "panda_rightfinger",
        "example-robot-data",
    ]


def test_a_file_without_a_suffix_is_a_robot_where_no_robot_is_called_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("mine", "ur5"):
        (tmp_path / name).write_text(load_robot("z1").description.xml, encoding="utf-8")
    assert load_robot("mine").n_actuators == 7
    assert load_robot("ur5").n_actuators == 6


# ------------------------------------------------------------------------------------------------ commanded joints


def test_joints_that_are_not_commanded_rest_at_neutral() -> None:
    robot, whole = load_robot("panda", actuators=SEVEN), load_robot("panda")
    assert robot.sites == tuple(SEVEN)
    assert robot.tcp_frame == whole.tcp_frame
    for q in np.random.default_rng(2).uniform(-1.0, 1.0, (5, 7)):
        one, other = gtpin.home(robot).moved_to(q), gtpin.home(whole).moved_to([*q, 0.0])
        np.testing.assert_allclose(one.T, other.T, rtol=0, atol=1e-13)
        np.testing.assert_allclose(one.jacobian, other.jacobian[:, :7], rtol=0, atol=1e-13)
    assert pin.computeTotalMass(robot.model) == pytest.approx(pin.computeTotalMass(whole.model))


def test_commands_come_in_the_order_of_the_actuators() -> None:
    robot = load_robot("panda", actuators=SEVEN[::-1])
    q = np.linspace(-1.0, 1.0, 7)
    usual = gtpin.home(load_robot("panda", actuators=SEVEN)).moved_to(q)
    np.testing.assert_allclose(gtpin.home(robot).moved_to(q[::-1]).T, usual.T, rtol=0, atol=1e-13)


def test_a_follower_rests_with_its_master() -> None:
    robot = load_robot("panda", tcp="panda_rightfinger", actuators=SEVEN)
    assert robot.followers == ()


def test_chosen_actuators_and_tcp_stay_with_a_model_that_is_written_and_pickled(tmp_path: Path) -> None:
    robot = load_robot("panda", tcp="panda_hand", actuators=SEVEN)
    model = gtpin.Model(gtpin.Geometry.nominal(robot))
    gtpin.write_model(model, tmp_path)
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (5, 7))
    for again in (
        gtpin.read_model(tmp_path),
        pickle.loads(pickle.dumps(model)),
        gtpin.read_model(tmp_path / "robot.urdf"),
    ):
        assert again.robot.sites == robot.sites
        assert again.robot.tcp_frame == "panda_hand"
        assert np.abs(again.predict(q).minus(model.predict(q))).max() < 1e-9


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["panda_joint9"], "no moving joint 'panda_joint9'"),
        (["panda_joint8"], "no moving joint 'panda_joint8'"),
        (["panda_joint1", "panda_joint1"], "comes twice"),
        (["panda_finger_joint2"], "follows panda_finger_joint1"),
    ],
)
def test_actuators_that_are_no_moving_joints_are_refused(names: list[str], said: str) -> None:
    with pytest.raises(RobotError, match=said) as caught:
        load_robot("panda", actuators=names)
    assert caught.value.hint


def test_actuators_that_a_urdf_names_keep_their_sites() -> None:
    description = load_robot("gantry_tau").description
    other = gtpin.Robot(with_actuators(description, ["track3", "track1", "track2"]))
    assert other.sites == ("cart3", "cart1", "cart2")
    q = np.array([0.1, -0.2, 0.3])
    usual = gtpin.home(load_robot("gantry_tau")).moved_to(q)
    np.testing.assert_allclose(gtpin.home(other).moved_to(q[[2, 0, 1]]).T, usual.T, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_joint_of_several_freedoms_is_refused_unless_the_actuators_leave_it_out(kind: str) -> None:
    text = (
        f'<robot name="free"><link name="world"/><link name="base"/><link name="arm"/><joint name="base_joint" type="{kind}">'
        '<parent link="world"/><child link="base"/></joint><joint name="turn" type="continuous"><parent link="base"/>'
        '<child link="arm"/><origin xyz="1 0 0"/></joint></robot>'
    )
    with pytest.raises(RobotError, match=r"base_joint has [36] degrees of freedom"):
        gtpin.Robot(RobotDescription.parse(text))
    assert gtpin.Robot(with_actuators(RobotDescription.parse(text), ["turn"])).sites == ("turn",)


def test_a_base_above_which_the_urdf_has_more_links_stays_where_these_put_it() -> None:
    text = example_path("ur5").read_text(encoding="utf-8").replace("</robot>", '<link name="hall"/><joint name="foot" '
        'type="fixed"><parent link="hall"/><child link="world"/><origin xyz="1 2 3"/></joint></robot>')  # fmt: skip
    q = np.linspace(-1.0, 1.0, 6)
    moved = gtpin.home(gtpin.Robot(RobotDescription.parse(text))).moved_to(q)
    np.testing.assert_allclose(
        moved.T, gtpin.home(load_robot("ur5")).moved_to(q).T + np.array([1.0, 2.0, 3.0]), rtol=0, atol=1e-13
    )


# ------------------------------------------------------------------------------------------------ the default TCP


@pytest.mark.parametrize(
    ("links", "tip"),
    [
        ([("a", "base", "revolute"), ("tool0", "base", "fixed"), ("b", "a", "revolute")], "tool0"),
        ([("b", "base", "revolute"), ("a", "base", "revolute")], "a"),
        ([("a", "base", "revolute"), ("b", "a", "revolute"), ("z", "base", "revolute")], "b"),
        ([("a", "base", "revolute"), ("flange", "a", "fixed"), ("tip", "flange", "fixed")], "tip"),
        ([("a", "base", "revolute"), ("camera", "a", "fixed"), ("hand", "a", "fixed"), ("c", "base", "fixed")], "hand"),
        (
            [("z", "base", "prismatic"), ("y", "z", "revolute"), ("x", "base", "continuous"), ("w", "x", "revolute")],
            "w",
        ),
    ],
)
def test_the_tcp_is_tool0_or_the_last_link_of_the_longest_chain(links: list[tuple[str, str, str]], tip: str) -> None:
    parts = (joint(f"to_{name}", parent, name, kind=kind) for name, parent, kind in links)
    assert robot_of("b", *parts).tcp_frame == tip
