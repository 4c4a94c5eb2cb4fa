"""3-D views of robots without rods: meshes where they are, lines where they are not, and encoders at their joints."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.data.instrument_tables import EncoderTable
from gtpin.errors import GtpinWarning
from gtpin.extras.view.displays import shapes
from gtpin.extras.view.still import still
from gtpin.model.model import FittedInstrument
from gtpin.report.instrument_places import InstrumentPlaces
from gtpin.report.skeleton import skeleton
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription
from gtpin.robot.library import load_robot

ARM_FILE = Path(__file__).parents[2] / "examples" / "effects" / "arm.urdf"
FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"
BASE, ROTATED, CRANK = np.array([-0.1, 0.0, 0.0]), 2.2, 0.3
"""Of the left drive, as in the URDF: its place, m, the angle of its crank from the x axis, rad, and the crank's length, m."""


def with_mesh(folder: Path, name: str) -> gtpin.Robot:
    shape = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    text = ARM_FILE.read_text(encoding="utf-8").replace('<link name="tool0"/>', f'<link name="tool0">{shape}</link>')
    (folder / "arm.urdf").write_text(text, encoding="utf-8")
    return gtpin.load_robot(folder / "arm.urdf")


def nominal(robot: gtpin.Robot) -> gtpin.Model:
    return gtpin.Model(gtpin.Geometry.nominal(robot))


def test_an_arm_whose_mesh_is_missing_is_drawn_by_lines_with_one_warning(tmp_path: Path, served) -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        served(nominal(with_mesh(tmp_path, "hand.stl")))
    (about,) = [str(w.message) for w in told if issubclass(w.category, GtpinWarning)]
    assert about.endswith("shapes are left out, for their meshes are missing: hand.stl")


@pytest.mark.parametrize("flat", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_a_map_has_few_ticks_along_the_axis_in_which_all_positions_are_alike(flat: tuple[int, int, int]) -> None:
    from gtpin.report.dataset import map_layout

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
    from gtpin.extras.view.still import still

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


def test_names_of_joints_move_with_the_arm(served) -> None:
    scene = served(nominal(gtpin.load_robot(ARM_FILE)))
    labels = {part.name: label for part, label in scene.labels.items()}
    scene.show(np.zeros(6))
    np.testing.assert_allclose(labels["elbow"].position, [0.0, 0.02, 0.52], atol=1e-9)
    scene.show(np.array([0.0, np.pi / 2.0, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(labels["elbow"].position, [0.42, 0.02, 0.1], atol=1e-9)


def test_a_mesh_beside_the_urdf_is_shown_and_goes_where_the_arm_goes(tmp_path: Path, served) -> None:
    corners = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0"
    facet = f"facet normal 0 0 1\nouter loop\n{corners}\nendloop\nendfacet"
    (tmp_path / "hand.stl").write_text(f"solid hand\n{facet}\nendsolid hand\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error", GtpinWarning)
        scene = served(nominal(with_mesh(tmp_path, "hand.stl")))
    scene.show(np.array([0.3, -0.2, 0.5, 0.1, 0.4, -0.6]))
    urdf = scene._visualizer._meshes._urdf
    np.testing.assert_allclose(urdf.get_transform("tool0")[:3, 3], scene.posture.T, rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "tcp"), [("ur5", None), ("panda", "panda_hand")])
@pytest.mark.filterwarnings("error", "ignore:.*does not move with panda_finger")
def test_meshes_of_a_package_are_found_beside_the_urdf(name: str, tcp: str | None) -> None:
    assert shapes(load_robot(name, tcp), {}).ngeoms >= 7


@pytest.mark.slow
def test_shapes_without_their_mesh_are_left_out_in_one_warning() -> None:
    description = load_robot("ur5").description
    text = description.xml.replace("ur5/visual/wrist", "ur5/nowhere/wrist")
    with pytest.warns(GtpinWarning, match=r"nowhere/wrist1.dae and 2 more") as caught:
        found = shapes(Chain(RobotDescription.parse(text, description.source)), {})
    assert len(caught) == 1
    assert found.ngeoms == shapes(load_robot("ur5"), {}).ngeoms - 3


def with_encoder() -> gtpin.Model:
    encoder = FittedInstrument(EncoderTable(name="elbow", kind="encoder", joint="elbow_left"))
    return gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(FIVE_BAR)), instruments=(encoder,))


def left_elbow(q: float) -> np.ndarray:
    """(3,) where the left crank ends, by trigonometry, base frame, m."""
    angle = ROTATED + q
    return BASE + CRANK * np.array([np.cos(angle), 0.0, np.sin(angle)])


def test_an_encoder_has_the_place_of_its_joint() -> None:
    places = InstrumentPlaces.of(with_encoder().instruments)
    assert places
    assert places.encoders == {"elbow": "elbow_left"}
    assert not places.targets


def test_the_page_shows_an_encoder_at_its_joint_and_moves_it_with_the_loop(served) -> None:
    scene = served(with_encoder())
    ball, (label,) = scene.instruments.drawn["/instruments/encoders/elbow"], scene.instruments.labels
    assert label.text == "elbow"
    for q in ([0.0, 0.0], [0.2, -0.1]):
        scene.show(np.array(q))
        np.testing.assert_allclose(ball.position, left_elbow(q[0]), atol=1e-9)
        np.testing.assert_allclose(label.position, left_elbow(q[0]), atol=1e-9)


def test_a_still_image_marks_and_names_an_encoder_at_its_joint() -> None:
    (axes,) = still(with_encoder()).axes
    (mark,) = [line for line in axes.lines if line.get_marker() == "D"]
    np.testing.assert_allclose(np.ravel(mark.get_data_3d()), left_elbow(0.0), atol=1e-9)
    assert "elbow" in [text.get_text().strip() for text in axes.texts]


def test_an_encoder_at_a_rod_is_where_the_rod_hangs_on_the_platform() -> None:
    robot = gtpin.load_robot("gantry_tau")
    encoder = FittedInstrument(EncoderTable(name="wrist", kind="encoder", joint="link2b_pitch"))
    model = gtpin.Model(gtpin.Geometry.nominal(robot), instruments=(encoder,))
    machine = skeleton(model)
    assert machine is not None
    (axes,) = still(model).axes
    (mark,) = [line for line in axes.lines if line.get_marker() == "D"]
    seat = machine.platform[robot.rod_sites.index("link2b")]
    np.testing.assert_allclose(np.ravel(mark.get_data_3d()), seat, atol=1e-9)
