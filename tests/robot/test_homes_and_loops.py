"""Which posture is home, and loops whose frames coincide or whose numbers are rounded, in all formats."""

import re
import sys
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from urdfs import joint, loop, own, urdf

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.cli import main
from gtpin.errors import ClosureError, DatasetError, GtpinWarning, RobotError
from gtpin.model.measured_robot import robot_of
from gtpin.robot.description import RobotDescription

FIELD = Path(__file__).parents[2] / "examples" / "field"
KEYFRAME, LEG, WELD = FIELD / "keyframe" / "fivebar.xml", FIELD / "telescope_leg" / "leg.xml", FIELD / "weld_loop"


def written(folder: Path, text: str, name: str = "robot.xml") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def spatial(kind: str = "fixed", lever: str = "0.1 0.2 0.3") -> str:
    """One driven joint and six passive ones about axes in all directions, whose last link is fixed to the base."""
    rng = np.random.default_rng(3)
    names = ["base", *(f"b{i}" for i in range(7))]
    parts, at = [], pin.SE3.Identity()
    for i in range(7):
        place, turn, axis = rng.uniform(-0.4, 0.4, 3), rng.uniform(-1.0, 1.0, 3), rng.standard_normal(3)
        text = (" ".join(map(repr, map(float, x))) for x in (place, axis / np.linalg.norm(axis), turn))
        xyz, axes, rpy = text
        parts.append(joint(f"j{i}", names[i], names[i + 1], xyz, axes, rpy=rpy))
        at = at * pin.SE3(pin.rpy.rpyToMatrix(*turn), place)
    on_base = at * pin.SE3(np.eye(3), np.array([float(x) for x in lever.split()]))
    xyz, rpy = (
        " ".join(map(repr, map(float, x))) for x in (on_base.translation, pin.rpy.matrixToRpy(on_base.rotation))
    )
    ends = f'<link1 link="b6" xyz="{lever}"/><link2 link="base" xyz="{xyz}" rpy="{rpy}"/>'
    return urdf("seven", *parts, f'<loop_joint name="cut" type="{kind}">{ends}</loop_joint>', own(["j0"], "b3"))


def frames_apart(robot: gtpin.Robot, posture: gtpin.ClosedPosture) -> float:
    """Largest component of log6 between the two frames of a loop, by Pinocchio alone."""
    (one, first), (other, second) = robot.anchors[:2]
    return float(np.abs(pin.log6((posture.data.oMi[one] * first).actInv(posture.data.oMi[other] * second))).max())


def test_a_fixed_loop_in_space_closes_six_coordinates() -> None:
    robot = gtpin.Robot(RobotDescription.parse(spatial()))
    home = gtpin.home(robot)
    postures = [home.moved_to([q]) for q in (-0.1, 0.07, 0.15)]
    assert max(frames_apart(robot, posture) for posture in postures) < 1e-12
    assert np.linalg.norm(postures[0].T - postures[1].T) > 1e-2
    # Its velocities are those of the finite motion.
    ahead, back = (postures[1].moved_to([0.07 + h]) for h in (1e-6, -1e-6))
    np.testing.assert_allclose(postures[1].jacobian[:3, 0], (ahead.T - back.T) / 2e-6, atol=1e-8)
    assert gtpin.static_forces(postures[1]).actuators.shape == (1,)  # its equations are not redundant


def test_the_anchor_of_a_fixed_loop_moves_as_one() -> None:
    robot = gtpin.Robot(RobotDescription.parse(spatial()))
    geometry = gtpin.Geometry.nominal(robot)
    names = [name for name in geometry.names if name.startswith("anchor")]
    assert names == [f"anchor[cut.{link}].{axis}" for link in ("b6", "base") for axis in "xyz"]
    q, step = np.array([[0.05], [-0.08]]), 1e-6
    model = gtpin.Model(geometry)
    exact = model.kinematics.geometry_jacobian(q, model.kinematics.forward(q))
    for name in names:
        column = geometry.names.index(name)
        moved = [
            geometry.with_values(geometry.values + s * np.eye(len(geometry.values))[column]) for s in (step, -step)
        ]
        there, back = (gtpin.Model(g).kinematics.forward(q) for g in moved)
        np.testing.assert_allclose(exact[:, :3, column], (there.T - back.T) / (2.0 * step), atol=1e-7)


@pytest.mark.slow
def test_a_machine_with_a_weld_is_calibrated_and_read_again(tmp_path: Path) -> None:
    with pytest.warns(GtpinWarning, match="nearest to zero"):
        robot = gtpin.load_robot(WELD / "robot.yaml", tcp="tool")
    made = simulate(robot, "crank", poses=60, seed=2)
    found = gtpin.calibrate(made.dataset, robot)
    # Chi-square of some 300 freedoms: sd sqrt(2 / 300) = 8 %.
    assert 0.65 < found.chi2_per_dof < 1.35
    gtpin.write_model(found.model, tmp_path)
    again = gtpin.read_model(tmp_path / "robot.urdf")
    assert np.abs(again.predict(made.commands.q).minus(found.model.predict(made.commands.q))).max() < 1e-9


def test_what_a_loop_holds_is_no_tool() -> None:
    parts = (
        joint("tool", "coupler", "pen", "0.1 0 0", kind="fixed"),
        joint("end", "coupler", "held", "0.3 0 0", "0 0 1"),
    )
    text = urdf(
        "r",
        joint("a", "base", "coupler"),
        joint("b", "base", "rocker", "0.3 0 0"),
        *parts,
        loop("held", "0 0 0", "rocker", "0 0 0"),
    )
    assert RobotDescription.parse(text).tree.tip == "pen"
    assert RobotDescription.parse(text.replace("pen", "tool0")).tree.tip == "tool0"


def test_frames_half_a_turn_apart_are_no_closed_posture() -> None:
    """A slider and a turntable welded to the base at half a turn of where they are: the slider's way closes the points too."""
    text = urdf(
        "turned",
        joint("drive", "base", "one", "0 0 0", "0 1 0"),
        joint("way", "one", "two", "0.3 0 0", "0 1 0", kind="continuous"),
        joint("up", "two", "three", "0.3 0 0", "0 1 0", kind="continuous"),
        joint("last", "three", "four", "0.2 0 0", "0 1 0", kind="continuous"),
        '<loop_joint name="cut" type="fixed"><link1 link="four"/><link2 link="base" xyz="0.5 0 0" rpy="0 3.0 0"/></loop_joint>',
        own(["drive"], "two"),
    )
    robot = gtpin.Robot(RobotDescription.parse(text))
    assert frames_apart(robot, gtpin.home(robot)) < 1e-9
    assert "others are" in robot.assembly.notes[0]


def test_frames_that_can_not_meet_are_named() -> None:
    text = (
        (WELD / "crank.xml")
        .read_text(encoding="utf-8")
        .replace('<site name="cut_right"', '<site quat="1 .01 0 0" name="cut_right"')
    )
    notes = quiet(lambda: gtpin.Robot(RobotDescription.parse(text))).assembly.notes
    assert "stay 20 mrad apart, about axes about which its joints do not turn" in notes[-1]


def test_home_is_the_keyframe_that_is_named_and_the_first_by_default(tmp_path: Path) -> None:
    text = KEYFRAME.read_text(encoding="utf-8")
    text = text.replace("</keyframe>", '<key name="mirrored" qpos="1.0 2.4 1.9 -2.4"/></keyframe>')
    file = written(tmp_path, text)
    np.testing.assert_array_equal(gtpin.load_robot(file).home_q, [2.0, 1.1])
    with pytest.warns(GtpinWarning, match="open at its home: the closed posture nearest to it"):
        np.testing.assert_array_equal(gtpin.load_robot(file, home="mirrored").home_q, [1.0, 1.9])
    with pytest.raises(RobotError, match="no keyframe is called 'lost'; keyframes are home, mirrored"):
        gtpin.load_robot(file, home="lost")


def test_home_is_given_as_commands_in_every_format(tmp_path: Path) -> None:
    for file, tcp in ((KEYFRAME, "pen"), (LEG, "foot"), (LEG.with_suffix(".urdf"), "foot")):
        plain = gtpin.load_robot(LEG, tcp) if file.suffix == ".urdf" else gtpin.load_robot(file, tcp)
        q = plain.home_q + 0.05
        robot = quiet(lambda file=file, tcp=tcp, q=q: gtpin.load_robot(file, tcp, home=q))
        np.testing.assert_array_equal(gtpin.home(robot).q, q)
        np.testing.assert_allclose(gtpin.home(robot).T, gtpin.home(plain).moved_to(q).T, atol=1e-9)
        again = gtpin.Robot(robot.description, tcp)
        np.testing.assert_array_equal(again.home_q, q)
    with pytest.raises(RobotError, match="home of 3 numbers for fivebar; give 2 finite numbers, of ml, mr"):
        gtpin.load_robot(KEYFRAME, home=[1.0, 2.0, 3.0])
    with pytest.raises(RobotError, match="a URDF has no keyframe 'stand'"):
        gtpin.load_robot(LEG.with_suffix(".urdf"), home="stand")


def quiet(load: Callable[[], gtpin.Robot]) -> gtpin.Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        return load()


def test_zero_outside_a_range_is_no_home() -> None:
    with pytest.warns(GtpinWarning, match="nearest to zero"):
        robot = gtpin.load_robot(LEG.with_suffix(".urdf"))
    np.testing.assert_allclose(robot.home_q, [0.4])
    posture = robot.home_coordinates
    assert 0.1 <= posture["thigh_j"] <= 1.4  # in the joints' ranges; the mirrored posture is not
    assert 0.2 <= posture["knee"] <= 2.8


def test_an_mjcf_is_told_nothing_that_it_can_not_hold(tmp_path: Path) -> None:
    text = re.sub(r"<keyframe>.*</keyframe>", "", KEYFRAME.read_text(encoding="utf-8"))
    with pytest.warns(GtpinWarning, match="initial posture: .*el=.* er=.*<keyframe>"):
        gtpin.load_robot(written(tmp_path, text))
    far = text.replace('name="p2" pos="0.28 0 0"', 'name="p2" pos="0.28 0 0.1"')
    robot = gtpin.load_robot(written(tmp_path, far.replace('pos="0.06 0 0"', 'pos="2.06 0 0"'), "far.xml"))
    with pytest.raises(ClosureError, match=r"m is the smallest gap found .*its keyframe") as refused:
        gtpin.home(robot)
    assert "<home>" not in str(refused.value)


@pytest.mark.parametrize(("angle", "off"), [(1.57, 1.6), (1.571, 0.41), (1.56, 0.0)])
def test_axes_that_are_nearly_parallel_are_named_up_to_the_tolerance(angle: float, off: float, tmp_path: Path) -> None:
    text = (FIELD / "rounded_right_angle" / "five_bar.urdf").read_text(encoding="utf-8").replace("1.57 ", f"{angle} ")
    file = written(tmp_path, text, "robot.urdf")
    if off:
        with pytest.warns(GtpinWarning) as told:
            gtpin.home(gtpin.load_robot(file))
        assert f"axes of ml and mr are {off} mrad from parallel" in str(told[-1].message)
        return
    robot = quiet(lambda: gtpin.load_robot(file))
    with pytest.raises(ClosureError, match=r"smallest gap found between their anchors \(up to 0\.\d+ m is rounding\)"):
        gtpin.home(robot)


def test_a_spherical_loop_is_closed_on_its_sphere() -> None:
    with pytest.warns(GtpinWarning, match="close only to 2.2e-08 m at home: the joints' axes do not quite meet"):
        robot = gtpin.load_robot(FIELD / "spherical_loop" / "spherical_6_digits.xml", tcp="tool")
    assert [len(normals) for normals in robot.planes] == [1]
    made = simulate(robot, "spherical", poses=60, seed=1)
    found = gtpin.calibrate(made.dataset, robot)
    assert 0.65 < found.chi2_per_dof < 1.35  # some 300 freedoms: sd 8 %


def test_formats_that_are_not_read_say_what_to_do(tmp_path: Path) -> None:
    for name, content, said in (
        ("robot.usd", "PXR-USDC", "URDF exporter"),
        ("robot.sdf", "<sdf/>", "sdf2mjcf"),
        ("robot.xml", "<sdf/>", "sdf2mjcf"),
        (
            "robot.urdf",
            '<robot name="r"><constraint/></robot>',
            "<constraint> is not read; close the loop by <loop_joint>",
        ),
    ):
        with pytest.raises(RobotError, match=said):
            gtpin.load_robot(written(tmp_path, content, name))


def test_a_yaml_of_something_else_beside_a_urdf_is_not_read(tmp_path: Path) -> None:
    written(tmp_path, "name: arm\n", "robot.yaml")
    parts = (joint("a", "base", "b"), loop("b", "0 0 0", "base", "0 0 0"), own(["a"], "b"))
    assert gtpin.load_robot(written(tmp_path, urdf("arm", *parts[:1]), "robot.urdf")).n_actuators == 1


@pytest.mark.parametrize("name", ["gantry_tau", "stewart", "ur5"])
def test_another_home_changes_no_pose(name: str) -> None:
    robot = gtpin.load_robot(name)
    q = robot.home_q + 0.05
    moved = gtpin.load_robot(name, home=q)
    np.testing.assert_allclose(gtpin.home(moved).T, robot.forward(q).T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(moved.forward(robot.home_q).T, gtpin.home(robot).T, rtol=0, atol=1e-12)


@pytest.mark.parametrize("home", [(1.9, 1.2), "home"])
def test_a_dataset_names_the_home_of_its_robot(home: tuple[float, ...] | str, tmp_path: Path) -> None:
    q = np.array([[2.0, 1.1], [1.9, 1.0]])
    made = gtpin.Dataset(str(KEYFRAME), ["a", "b"], q, np.zeros((2, 3)), tcp="pen", home=home)
    made.write(tmp_path / "data")
    read = gtpin.Dataset.read(tmp_path / "data")
    assert read.home == home
    np.testing.assert_array_equal(robot_of(read).home_q, (2.0, 1.1) if home == "home" else home)
    with pytest.raises(DatasetError, match=r"column home: home of 1 numbers for fivebar; give 2 finite numbers"):
        robot_of(replace(read, home=(1.0,)))


def test_commands_take_home_and_actuators(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def predicted(*options: str) -> np.ndarray:
        out = tmp_path / "out.csv"
        arguments = [str(KEYFRAME), str(KEYFRAME.parent / "q.csv"), "--tcp", "pen", *options, "-o", str(out), "--force"]
        monkeypatch.setattr(sys, "argv", ["gtpin", "predict", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code in (0, None)
        return np.genfromtxt(out, delimiter=",", skip_header=1)[:, 1:4]

    plain = predicted()
    for options in (("--home", "1.9,1.2"), ("--home", "home"), ("--actuators", "ml,mr")):
        np.testing.assert_allclose(predicted(*options), plain, rtol=0, atol=1e-12)
    assert np.abs(predicted("--actuators", "mr,ml") - plain).max() > 1e-2


@pytest.mark.parametrize("limit", [(5.0, 8.0), (0.0, 3.0)])
def test_ranges_of_passive_joints_may_be_half_a_turn_or_more_from_zero(limit: tuple[float, float]) -> None:
    """A crank of 0.5 m and a rod of 1 m, whose slide is 1.5 m from the crank's axis, or 0.5 m with the rod turned back."""
    parts = (
        joint("a", "base", "crank", kind="continuous"),
        joint("b", "crank", "rod", "0.5 0 0", limit=(3.3, 9.0) if limit[0] == 0.0 else (-1.0, 1.0)),
        joint("s", "base", "slide", f"{-limit[0]} 0 0", "1 0 0", kind="prismatic", limit=limit),
        loop("rod", "1 0 0", "slide", "0 0 0"),
        own(["a"], "slide"),
    )
    with pytest.warns(GtpinWarning, match="nearest to zero"):
        robot = loaded_text(urdf("crank", *parts))
    home = robot.home_coordinates
    assert home["s"] == pytest.approx(1.5 + limit[0], abs=1e-9)
    assert home["b"] == pytest.approx(2.0 * np.pi if limit[0] == 0.0 else 0.0, abs=1e-9)
    q = 0.3
    expected = 0.5 * np.cos(q) + np.sqrt(1.0 - (0.5 * np.sin(q)) ** 2)
    assert robot.forward([q]).T[0] == pytest.approx(expected, abs=1e-12)


def loaded_text(text: str) -> gtpin.Robot:
    with tempfile.TemporaryDirectory() as folder:
        return gtpin.load_robot(written(Path(folder), text, "robot.urdf"))


def test_a_robot_with_a_given_home_warns_once(tmp_path: Path) -> None:
    arm = urdf("arm", joint("a", "base", "left"), joint("b", "base", "right"))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        gtpin.load_robot(written(tmp_path, arm, "robot.urdf"), home=[0.1, 0.2])
    texts = [str(one.message) for one in caught]
    assert len([text for text in texts if "names no TCP" in text]) == 1


def slider_crank(home: str = "") -> str:
    return urdf(
        "crank",
        joint("a", "base", "crank", limit=(0.1, 2.36913578)),
        joint("b", "crank", "rod", "0.5 0 0", limit=3.0),
        joint("s", "base", "slide", "0 0 0", "1 0 0", kind="prismatic", limit=3.0),
        loop("rod", "1 0 0", "slide", "0 0 0"),
        own(["a"], "slide", home),
    )


@pytest.mark.parametrize("home", ["", '<home><joint name="a" value="1.2"/><joint name="s" value="-0.1"/></home>'])
def test_an_exported_urdf_keeps_the_home_that_was_chosen(home: str, tmp_path: Path) -> None:
    with pytest.warns(GtpinWarning, match="closed posture nearest to"):
        robot = loaded_text(slider_crank(home))
    geometry = gtpin.Geometry.nominal(robot)
    text = gtpin.Model(geometry.with_values(geometry.values + 1e-4)).kinematics.urdf()
    assert text.count("<home") == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error", GtpinWarning)
        again = gtpin.load_robot(written(tmp_path, text, "out.urdf"))
    np.testing.assert_allclose(again.home_q, robot.home_q, rtol=0, atol=1e-9)
    assert again.home_coordinates["s"] == pytest.approx(robot.home_coordinates["s"], abs=1e-2)


def test_two_homes_are_refused() -> None:
    with pytest.raises(RobotError, match="two <home> elements; keep one"):
        RobotDescription.parse(slider_crank('<home q="1" tcp_xyz="1 0 0" tcp_rotvec="0 0 0"/>' * 2))
