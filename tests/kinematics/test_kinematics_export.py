"""A geometry written into a URDF: other software reads it, gtpin finds the same robot in it."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from closures import Closures
from loaded_machines import drawn
from quick_first import quick_first

import gtpin
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.rotations import log
from gtpin.model.model_folder import calibrated_urdf
from gtpin.robot.description import RobotDescription


def written(geometry: gtpin.Geometry, folder: Path) -> Path:
    file = folder / "robot.urdf"
    file.write_text(calibrated_urdf(gtpin.Model(geometry)), encoding="utf-8")
    return file


@pytest.mark.parametrize("seed", quick_first(range(3)))
def test_an_exported_robot_predicts_what_the_model_predicts(
    machine: Closures, loaded: gtpin.Robot, seed: int, tmp_path: Path
) -> None:
    geometry = drawn(loaded, seed)
    again = gtpin.load_robot(written(geometry, tmp_path))
    q = machine.commands(200, seed=seed)
    model, reloaded = Kinematics(geometry).forward(q), Kinematics(gtpin.Geometry.nominal(again)).forward(q)
    assert model.reached.all()
    assert np.abs(model.T - reloaded.T).max() <= 1e-9
    assert np.abs(log(model.R @ np.swapaxes(reloaded.R, 1, 2))).max() <= 1e-9
    posture = gtpin.home(again)
    for i in range(20):
        assert np.abs(posture.moved_to(q[i]).T - model.T[i]).max() <= 1e-9


def test_an_exported_robot_has_the_models_geometry_as_its_nominal(loaded: gtpin.Robot, tmp_path: Path) -> None:
    geometry = drawn(loaded, 3)
    values = dict(zip(geometry.names, geometry.values, strict=True))
    again = gtpin.Geometry.nominal(gtpin.load_robot(written(geometry, tmp_path)))
    for name, value in zip(again.names, again.values, strict=True):
        if not name.startswith(("track_direction", "arm_axis")):  # these are zero by definition, about the new axis
            assert value == pytest.approx(values[name], abs=1e-14)


def test_yourdfpy_and_pinocchio_load_an_exported_robot(loaded: gtpin.Robot, tmp_path: Path) -> None:
    file = written(drawn(loaded, 4), tmp_path)
    other = yourdfpy.URDF.load(str(file), load_meshes=False, load_collision_meshes=False, build_scene_graph=False)
    assert other.validate()
    model = pin.buildModelFromUrdf(str(file))
    assert (model.nq, model.nv) == (loaded.model.nq, loaded.model.nv)
    assert list(model.names) == list(loaded.model.names)


def test_an_export_keeps_links_loops_and_everything_that_is_not_geometry(loaded: gtpin.Robot, tmp_path: Path) -> None:
    before = ElementTree.fromstring(loaded.description.xml)
    after = ElementTree.parse(written(drawn(loaded, 5), tmp_path)).getroot()

    def text_of(elements: list[ElementTree.Element]) -> list[str]:
        return ["".join(ElementTree.tostring(e, encoding="unicode").split()) for e in elements]

    assert text_of(before.findall("link")) == text_of(after.findall("link"))
    assert [loop.get("name") for loop in before.findall("loop_joint")] == [
        e.get("name") for e in after.findall("loop_joint")
    ]
    for tag in ("actuator", "platform", "rod", "gravity", "tolerance"):
        assert text_of(before.findall(f"gtpin/{tag}")) == text_of(after.findall(f"gtpin/{tag}"))
    for one, other in zip(before.findall("joint"), after.findall("joint"), strict=True):
        assert (one.get("name"), one.get("type")) == (other.get("name"), other.get("type"))
        for tag in ("parent", "child", "limit"):
            assert text_of(one.findall(tag)) == text_of(other.findall(tag))


def test_home_is_told_anew_and_closes(machine: Closures, loaded: gtpin.Robot, tmp_path: Path) -> None:
    geometry = drawn(loaded, 6)
    again = gtpin.load_robot(written(geometry, tmp_path))
    told = again.description.home
    assert told is not None
    posture = gtpin.home(again)
    np.testing.assert_allclose(posture.T, told.tcp_xyz, rtol=0, atol=1e-12)
    np.testing.assert_allclose(log(posture.R), told.tcp_rotvec, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(np.array(told.q), machine.q)
    assert np.linalg.norm(posture.T - machine.T) > 1e-5  # it did move
    assert np.linalg.norm(posture.T - machine.T) < 0.1


def test_a_platform_whose_zero_was_home_has_its_zero_at_the_new_home(robot: gtpin.Robot, tmp_path: Path) -> None:
    again = gtpin.load_robot(written(drawn(robot, 7), tmp_path))
    pin.forwardKinematics(again.model, again.data, pin.neutral(again.model))
    place = again.data.oMi[again.tcp_joint] * again.tcp_placement
    np.testing.assert_allclose(place.translation, gtpin.home(again).T, rtol=0, atol=1e-12)


def test_track_directions_are_exported_as_unit_vectors_without_the_drives_scale(
    robot: gtpin.Robot, tmp_path: Path
) -> None:
    geometry = drawn(robot, 8, scale="actuator")
    root = ElementTree.parse(written(geometry, tmp_path)).getroot()
    for k in (1, 2, 3):
        axis = next(j for j in root.findall("joint") if j.get("name") == f"track{k}").find("axis")
        assert axis is not None
        assert np.linalg.norm([float(x) for x in axis.get("xyz", "").split()]) == pytest.approx(1.0, abs=1e-15)


def test_an_axis_that_went_without_saying_is_written(gantry: Closures, tmp_path: Path) -> None:
    """<axis> may be left out of a URDF, and is (1, 0, 0) then."""
    start = gantry.urdf.index("<axis", gantry.urdf.index('name="track1"'))
    bare = gantry.urdf[:start] + gantry.urdf[gantry.urdf.index("/>", start) + 2 :]
    geometry = drawn(gtpin.Robot(RobotDescription.parse(bare)), 9)
    again = gtpin.load_robot(written(geometry, tmp_path))
    q = gantry.commands(20, seed=9)
    difference = Kinematics(geometry).forward(q).minus(Kinematics(gtpin.Geometry.nominal(again)).forward(q))
    assert np.abs(difference).max() <= 1e-9


def test_a_tool_of_ones_own_does_not_change_home_and_is_the_exported_tcp(gantry: Closures, tmp_path: Path) -> None:
    """<home> tells the pose of the TCP that the URDF names, whichever link the caller takes for the TCP."""
    tool = '<link name="tool"/><joint name="tool_mount" type="fixed"><parent link="platform"/><child link="tool"/>'
    tool += '<origin xyz="0.2 -0.4 0.7" rpy="0.5 0.6 0.7"/></joint></robot>'
    file = tmp_path / "tool.urdf"
    file.write_text(gantry.urdf.replace("</robot>", tool), encoding="utf-8")
    usual, with_tool = gtpin.load_robot(file), gtpin.load_robot(file, tcp="tool")
    one, other = gtpin.home(usual), gtpin.home(with_tool)
    np.testing.assert_allclose(one.configuration, other.configuration, rtol=0, atol=1e-12)
    place = one.tcp * pin.SE3(pin.rpy.rpyToMatrix(0.5, 0.6, 0.7), np.array([0.2, -0.4, 0.7]))
    np.testing.assert_allclose(other.T, place.translation, rtol=0, atol=1e-12)
    again = gtpin.load_robot(written(gtpin.Geometry.nominal(with_tool), tmp_path))
    assert again.tcp_frame == "tool"
    np.testing.assert_allclose(gtpin.home(again).T, other.T, rtol=0, atol=1e-12)
    assert again.description.home is not None
    assert again.description.home.link == "tcp"
    np.testing.assert_allclose(again.description.home.tcp_xyz, one.T, rtol=0, atol=1e-12)
