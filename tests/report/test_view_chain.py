"""3-D views of robots without rods: meshes where they are, lines where they are not."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.errors import GtpinWarning

ARM_FILE = Path(__file__).parents[2] / "examples" / "effects" / "arm.urdf"


def with_mesh(folder: Path, name: str) -> gtpin.Robot:
    shape = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    text = ARM_FILE.read_text(encoding="utf-8").replace('<link name="tool0"/>', f'<link name="tool0">{shape}</link>')
    (folder / "arm.urdf").write_text(text, encoding="utf-8")
    return gtpin.load_robot(folder / "arm.urdf")


def scene_of(robot: gtpin.Robot):
    pytest.importorskip("viser")
    from gtpin.view.scene import Scene

    return Scene(gtpin.Model(gtpin.Geometry.nominal(robot)), None, port=0)


def test_an_arm_whose_mesh_is_missing_is_drawn_by_lines_with_one_warning(tmp_path: Path) -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        scene = scene_of(with_mesh(tmp_path, "hand.stl"))
    scene.stop()
    (about,) = [str(w.message) for w in told if issubclass(w.category, GtpinWarning)]
    assert about.endswith("shapes are left out, for their meshes are missing: hand.stl")


@pytest.mark.parametrize("flat", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_a_map_has_few_ticks_along_the_axis_in_which_all_positions_are_alike(flat: tuple[int, int, int]) -> None:
    from gtpin.report.poses import map_layout

    across = np.random.default_rng(0).uniform(-0.2, 0.2, (30, 3)) * [0.01, 1.0, 1.0]
    T = across[:, np.argsort(flat)]
    thin = "xyz"[flat[0]]
    for view in ("xy", "xz", "yz"):
        layout = map_layout(T, view)
        assert ("tickvals" in layout["xaxis"]) == (view[0] == thin)
        assert ("range" in layout["yaxis"]) == (view[1] == thin)


@pytest.mark.parametrize(("axis", "seen"), [("0 0 1", (0, 0, 1)), ("0 1 0", (0, -1, 0)), ("1 0 0", (1, 0, 0))])
def test_the_picture_of_a_planar_robot_is_seen_along_its_axes(tmp_path: Path, axis: str, seen: tuple[int, ...]) -> None:
    pytest.importorskip("matplotlib")
    from gtpin.view.still import still

    along = {
        "0 0 1": ("0.3 0.1 0", "0.1 0.3 0"),
        "0 1 0": ("0.3 0 0.1", "0.1 0 0.3"),
        "1 0 0": ("0 0.3 0.1", "0 0.1 0.3"),
    }
    first, second = along[axis]
    limit = f'<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
    (tmp_path / "planar.urdf").write_text(
        f"""<robot name="planar"><link name="base"/><link name="a"/><link name="b"/><link name="tool0"/>
        <joint name="one" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0 0"/>{limit}</joint>
        <joint name="two" type="revolute"><parent link="a"/><child link="b"/><origin xyz="{first}"/>{limit}</joint>
        <joint name="tip" type="fixed"><parent link="b"/><child link="tool0"/><origin xyz="{second}"/></joint></robot>"""
    )
    axes = still(gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(tmp_path / "planar.urdf")))).axes[0]
    e, a = np.radians([axes.elev, axes.azim])
    np.testing.assert_allclose([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], seen, atol=1e-9)
    assert len(getattr(axes, f"get_{'xyz'[int(np.argmax(np.abs(seen)))]}ticks")()) == 0


def test_names_of_joints_move_with_the_arm() -> None:
    scene = scene_of(gtpin.load_robot(ARM_FILE))
    try:
        labels = {part.name: label for part, label in scene.labels.items()}
        scene.show(np.zeros(6))
        np.testing.assert_allclose(labels["elbow"].position, [0.0, 0.02, 0.52], atol=1e-9)
        scene.show(np.array([0.0, np.pi / 2.0, 0.0, 0.0, 0.0, 0.0]))
        np.testing.assert_allclose(labels["elbow"].position, [0.42, 0.02, 0.1], atol=1e-9)
    finally:
        scene.stop()


def test_a_mesh_beside_the_urdf_is_shown_and_goes_where_the_arm_goes(tmp_path: Path) -> None:
    corners = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0"
    facet = f"facet normal 0 0 1\nouter loop\n{corners}\nendloop\nendfacet"
    (tmp_path / "hand.stl").write_text(f"solid hand\n{facet}\nendsolid hand\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error", GtpinWarning)
        scene = scene_of(with_mesh(tmp_path, "hand.stl"))
    try:
        q = np.array([0.3, -0.2, 0.5, 0.1, 0.4, -0.6])
        scene.show(q)
        urdf = scene._visualizer._meshes._urdf
        np.testing.assert_allclose(urdf.get_transform("tool0")[:3, 3], scene.posture.T, rtol=0, atol=1e-9)
    finally:
        scene.stop()
