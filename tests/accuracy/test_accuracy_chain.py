"""Accuracy of arms and of loops that are no rods."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from urdfs import joint, robot_of

import gtpin
from gtpin.accuracy.analysis import analyse
from gtpin.accuracy.dexterity import dexterity
from gtpin.accuracy.figures import write_accuracy
from gtpin.accuracy.workspace import default_commands, filled_workspace
from gtpin.cli import main
from gtpin.report.accuracy import AccuracyPresentation, slices
from gtpin.robot.description import RobotDescription

FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"


def robot(*joints: tuple[str, str, str, float]) -> gtpin.Model:
    """A chain of (type, axis, place, half range) joints."""
    links = ["base", *(f"l{i}" for i in range(len(joints)))]
    parts = [
        joint(f"j{i}", links[i], links[i + 1], place, axis, kind=kind, limit=limit)
        for i, (kind, axis, place, limit) in enumerate(joints)
    ]
    made = robot_of("chain", *parts, joint("tool", links[-1], "tool0", "0.4 0 0", kind="fixed"))
    return gtpin.Model(gtpin.Geometry.nominal(made))


GANTRY = robot(
    ("prismatic", "1 0 0", "0 0 0", 0.5), ("prismatic", "0 1 0", "0 0 0", 0.3), ("prismatic", "0 0 1", "0 0 0", 0.1)
)
SCARA = robot(("revolute", "0 0 1", "0 0 0.5", 3.0), ("revolute", "0 0 1", "0.4 0 0", 3.0))


def test_a_gantry_reaches_its_box_alike_everywhere() -> None:
    space = filled_workspace(GANTRY)
    assert space.reachable.all()
    assert space.volume == pytest.approx(1.0 * 0.6 * 0.2, rel=0.01)
    assert space.across == 2
    assert_allclose(space.dexterity.condition, 1.0)
    assert_allclose(space.dexterity.singularity, 1.0)
    assert_allclose(space.dexterity.rotation_gain, 0.0, atol=1e-12)
    assert_allclose(np.nanmax(space.dexterity.limit), 0.1, rtol=0.05)  # the middle of the shortest range


def test_each_posture_is_in_its_cell_and_a_cell_has_the_median_of_its_postures() -> None:
    space = filled_workspace(SCARA)
    for i, axis in enumerate(space.axes):
        size = axis[1] - axis[0] if len(axis) > 1 else 1e-9
        assert (np.abs(space.poses.T[:, i] - axis[space.cell[:, i]]) <= 0.5 * size * (1.0 + 1e-9)).all()
    values = np.where(np.arange(len(space.q)) % 7 == 0, np.inf, space.q[:, 0])
    table = space.on_grid(values)
    one = space.cell[5]
    here = (space.cell == one).all(axis=1) & np.isfinite(values)
    assert table[tuple(one)] == pytest.approx(float(np.median(values[here])), abs=1e-12)
    assert np.isnan(table[~space.reachable]).all()


def test_a_flat_workspace_is_cut_along_its_plane_and_has_no_volume() -> None:
    space = filled_workspace(SCARA)
    assert space.across == 2
    assert len(space.axes[2]) == 1
    assert space.volume == 0.0


def test_two_links_of_equal_length_are_singular_where_they_are_stretched_or_folded() -> None:
    q = np.array([[0.3, 0.0], [0.3, np.pi], [0.3, np.pi / 2.0]])
    found = dexterity(SCARA, q, SCARA.kinematics.forward(q))
    # Of the two singular values of the position the smaller is 0 there; in between their product is l1 l2 |sin(q2)|.
    assert_allclose(found.position_gain[:2, 1], 0.0, atol=1e-12)
    assert np.prod(found.position_gain[2, :2]) == pytest.approx(0.4 * 0.4)
    assert found.condition[2] < 10.0 < found.condition[:2].min()


def test_commands_fill_the_ranges() -> None:
    q = default_commands(GANTRY, 500)
    limit = np.array([0.5, 0.3, 0.1])
    assert (np.abs(q) <= limit).all()
    assert (np.ptp(q, axis=0) > 1.9 * limit).all()


@pytest.mark.slow
@pytest.mark.parametrize("model", [GANTRY, SCARA, gtpin.read_model("ur5")], ids=["gantry", "scara", "ur5"])
def test_the_command_writes_maps_a_page_and_dexterity(
    model: gtpin.Model, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    gtpin.write_model(model, tmp_path / "model")
    monkeypatch.setattr(sys, "argv", ["gtpin", "sensitivity", str(tmp_path / "model"), "-o", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    assert "report.html" in capsys.readouterr().out
    maps = {f"map_{name}.png" for name in ("position", "orientation", "condition", "singularity")}
    written = {file.name for file in (tmp_path / "out").iterdir()}
    assert written == {".gtpin.json", "sensitivity.csv", "accuracy.json", "report.html", "sensitivity.png"} | maps
    told = json.loads((tmp_path / "out" / "accuracy.json").read_text(encoding="utf-8"))
    assert set(told["dexterity"]) == {"position_gain", "rotation_gain", "condition", "singularity", "limit"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for site in model.robot.sites:
        assert f">{site}</th>" in page
    assert "postures that fill the joints" in page
    assert "rod" not in page.split("<h2")[3]


@pytest.mark.slow
@pytest.mark.parametrize(("tcp", "bounded"), [("tool0", True), ("left_far", False)])
def test_a_five_bar_has_maps_but_none_of_a_condition_number_that_is_infinite_everywhere(
    tcp: str, bounded: bool, tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    # The left drive alone moves the elbow, from which the left far link reaches on.
    text = FIVE_BAR.read_text(encoding="utf-8").replace('<platform link="tool0"/>', f'<platform link="{tcp}"/>')
    model = gtpin.Model(gtpin.Geometry.nominal(gtpin.Robot(RobotDescription.parse(text, "five_bar"))))
    found = analyse(model, default_commands(model, 30))
    write_accuracy(found, tmp_path)
    assert (tmp_path / "map_condition.png").exists() == bounded
    assert {f"map_{name}.png" for name in ("position", "orientation", "singularity")} <= {
        f.name for f in tmp_path.iterdir()
    }
    assert ("condition number" in [name for name, _ in slices(found)[0].options]) == bounded
    page = AccuracyPresentation(found).page()
    assert "Expect a position error" in page
    assert "at the given commands" in page
    assert "over the ranges of the drives" in analyse(found.model).summary()


@pytest.mark.filterwarnings("ignore:changes of orientation are left out")
@pytest.mark.parametrize("name", ["scara", "five_bar", "gantry_tau"])
def test_a_finite_step_moves_any_robot_as_its_derivative_says(name: str) -> None:
    """What is left is of second order: eight steps (four poses, both signs) of (5e-5)^2 m each, times some levers."""
    model = SCARA if name == "scara" else gtpin.read_model(str(FIVE_BAR) if name == "five_bar" else name)
    found = gtpin.analyse(model, default_commands(model, 4)).sensitivity
    exact, linear = found.exact.position, found.linear.position
    assert_allclose(exact, linear, rtol=2e-3, atol=8 * 5 * 5e-5**2)
    assert np.nanmax(exact) > 8 * 4e-5


def test_an_unreachable_pose_is_told() -> None:
    with pytest.raises(gtpin.GtpinError, match="no commands"):
        analyse(GANTRY, np.zeros((0, 3)))
