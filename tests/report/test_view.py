"""The machine and its gap in 3-D and as a still image."""

from __future__ import annotations

import re
import sys
import threading
import urllib.request
from dataclasses import replace
from typing import TYPE_CHECKING

import closures
import numpy as np
import pinocchio as pin
import pytest
from browsers import SLOW, launched

import gtpin
import gtpin.cli
from gtpin import Frame, Geometry, Model, load_robot
from gtpin.data import Dataset, InstrumentSection
from gtpin.errors import DatasetError, GtpinError, GtpinWarning, ModelError
from gtpin.extras.view.displays import of_errors, of_share, parts, robot_as_modelled, shapes
from gtpin.extras.view.gap import gap_of, whose
from gtpin.extras.view.still import still, write_still
from gtpin.kinematics.rotations import exp
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription

if TYPE_CHECKING:
    from gtpin.extras.view.scene import Scene

NOMINAL = Model(Geometry.nominal(load_robot("gantry_tau")))
WHOSE = (
    (NOMINAL, "of the nominal model"),
    (replace(NOMINAL, covariance=np.eye(len(NOMINAL.geometry.values))), "of the calibrated geometry"),
    (replace(NOMINAL, effects=("any",)), "after the causes"),
)


def dataset_of(
    model: Model, shift: np.ndarray | None = None, orientation: bool = True, frame: str = "robot"
) -> Dataset:
    """Exactly what a model predicts, shifted in the instrument's frame."""
    q = np.random.default_rng(4).uniform(-0.4, 0.4, (25, 3))
    poses = model.predict(q)
    return Dataset(
        robot="gantry_tau",
        pose=[str(i) for i in range(len(q))],
        q=q,
        position=poses.T + (0.0 if shift is None else shift),
        orientation=poses.quaternions if orientation else None,
        instrument=InstrumentSection(frame=frame),
    )


def lengthened(link: str, by: float) -> Model:
    geometry = NOMINAL.geometry
    values = geometry.values.copy()
    values[geometry.names.index(f"length[{link}]")] += by
    return Model(geometry.with_values(values))


def test_errors_are_measured_less_predicted():
    shift = np.array([1e-4, -2e-4, 5e-5])
    gap = gap_of(NOMINAL, dataset_of(NOMINAL, shift))
    np.testing.assert_allclose(gap.error, np.tile(shift, (25, 1)), atol=1e-12)
    np.testing.assert_allclose(gap.T, NOMINAL.predict(gap.q).T, atol=1e-12)
    np.testing.assert_allclose(gap.length, np.linalg.norm(shift), atol=1e-12)
    assert gap.rms == pytest.approx(np.linalg.norm(shift))


def test_each_error_keeps_its_pose_and_its_row_in_the_table():
    dataset = dataset_of(NOMINAL)
    gap = gap_of(NOMINAL, dataset.take([3, 1, 4]))
    assert gap.pose.tolist() == ["3", "1", "4"]
    assert gap.row.tolist() == [5, 3, 6]
    np.testing.assert_array_equal(gap.q, dataset.q[[3, 1, 4]])


@pytest.mark.parametrize(("model", "told"), WHOSE, ids=[told for _, told in WHOSE])
def test_errors_are_said_to_be_those_of_the_model_that_was_given(model, told):
    assert whose(model) == told


def test_the_still_image_tells_whose_errors_it_shows():
    nominal = gap_of(NOMINAL, dataset_of(NOMINAL, np.array([1e-4, 0.0, 0.0])))
    (axes,) = still(NOMINAL, replace(nominal, whose="of somebody's model")).axes
    assert "position errors of somebody's model" in axes.get_title()
    (axes,) = still(NOMINAL).axes
    assert "errors" not in axes.get_title()


def test_errors_seen_from_elsewhere_are_told_in_the_base_frame():
    turn = exp(np.array([[0.2, -0.4, 1.1]]))[0]
    seen = Model(NOMINAL.geometry, Frame(np.array([1.0, 2.0, 3.0]), turn))
    shift = np.array([1e-4, -2e-4, 5e-5])
    gap = gap_of(seen, dataset_of(seen, turn @ shift, frame="free"))
    np.testing.assert_allclose(gap.error, np.tile(shift, (25, 1)), atol=1e-12)
    np.testing.assert_allclose(gap.T, NOMINAL.predict(gap.q).T, atol=1e-12)


@pytest.mark.parametrize("link", ["1", "2b", "3c"])
def test_a_rod_that_is_too_long_has_the_whole_gap(link):
    gap = gap_of(NOMINAL, dataset_of(lengthened(link, 2e-4)))
    assert gap.share[f"link{link}"] > 0.99
    assert sum(gap.share.values()) == pytest.approx(1.0)


def test_without_a_gap_no_rod_has_a_share():
    exact = gap_of(
        NOMINAL, replace(dataset_of(NOMINAL), instrument=InstrumentSection(position_sigma=1e-5, orientation_sigma=1e-5))
    )
    assert set(exact.share.values()) == {0.0}


def test_errors_are_magnified_by_a_round_factor_to_a_tenth_of_the_workspace():
    gap = gap_of(NOMINAL, dataset_of(NOMINAL, np.array([1e-4, 0.0, 0.0])))
    factor = gap.magnification()
    assert re.fullmatch(r"[125]0*", f"{factor:.0f}")
    assert 0.02 < factor * 1e-4 / np.ptp(gap.T, axis=0).max() <= 0.1
    assert gap_of(NOMINAL, dataset_of(NOMINAL)).magnification() >= 1.0


def test_poses_out_of_reach_are_left_out_by_name():
    stewart = Model(Geometry.nominal(load_robot("stewart")))
    lower, upper = stewart.robot.lower, stewart.robot.upper
    q = (lower + upper) / 2.0 + np.linspace(-0.1, 0.1, 8)[:, None] * (upper - lower)
    q[3] = [lower[0], upper[1], lower[2], upper[3], lower[4], upper[5]]  # no plate is so twisted
    poses = stewart.predict(q)
    assert poses.reached.tolist() == [i != 3 for i in range(8)]
    poses.T[3] = poses.T[0]
    with pytest.warns(GtpinWarning, match="poses 3"):
        gap = gap_of(stewart, Dataset(robot="stewart", pose=[str(i) for i in range(8)], q=q, position=poses.T))
    assert gap.pose.tolist() == ["0", "1", "2", "4", "5", "6", "7"]
    np.testing.assert_array_equal(gap.error, 0.0)


def test_a_model_that_does_not_know_where_the_instrument_stood_is_refused():
    with pytest.raises(ModelError, match="stood elsewhere"):
        gap_of(NOMINAL, dataset_of(NOMINAL, frame="free"))


def test_a_dataset_of_another_robot_is_refused():
    with pytest.raises(DatasetError):
        gap_of(Model(Geometry.nominal(load_robot("stewart"))), dataset_of(NOMINAL))


def test_colours_grow_redder_with_the_share_and_the_error():
    red = [of_share(share)[0] - of_share(share)[2] for share in (0.0, 0.2, 0.5)]
    assert red == sorted(set(red))
    colors = of_errors(np.linspace(0.0, 1e-4, 50))
    assert colors.shape == (50, 3)
    assert ((colors >= 0.0) & (colors <= 1.0)).all()
    assert colors[-1, 0] - colors[-1, 2] > colors[0, 0] - colors[0, 2]


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".png", ".svg", ".pdf"])
def test_a_still_image_is_written_in_the_format_of_its_ending(tmp_path, ending):
    gap = gap_of(NOMINAL, dataset_of(lengthened("2a", 2e-4)))
    write_still(tmp_path / f"still{ending}", NOMINAL, gap)
    start = (tmp_path / f"still{ending}").read_bytes()[:300]
    assert {".png": b"PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}[ending] in start
    assert {file.name for file in tmp_path.iterdir()} == {".gtpin.json", f"still{ending}"}


def test_a_still_image_names_the_parts_and_tells_how_much_errors_are_magnified():
    gap = gap_of(NOMINAL, dataset_of(NOMINAL, np.array([1e-4, 0.0, 0.0])))
    (axes,) = still(NOMINAL, gap).axes
    told = " ".join(text.get_text() for text in axes.texts)
    for site in (*NOMINAL.robot.rod_sites, *NOMINAL.robot.sites, "platform"):
        assert site in told
    assert "100 µm RMS" in axes.get_title()
    assert f"{gap.magnification():,.0f} times" in axes.get_title()


@pytest.mark.parametrize("name", ["still.gif", "still"])
def test_an_image_of_another_kind_is_refused(tmp_path, name):
    with pytest.raises(GtpinError, match="not an image"):
        write_still(tmp_path / name, NOMINAL)
    assert list(tmp_path.iterdir()) == []


def test_rods_are_coloured_by_their_share_and_keep_their_colour_without():
    robot = robot_as_modelled(NOMINAL)
    share = dict.fromkeys(robot.rod_sites, 0.0) | {"link2a": 0.6}
    frames = robot.model.frames

    def color(found, link):
        return next(s.meshColor for s in found.geometryObjects if frames[s.parentFrame].name == link)

    shared, plain = shapes(robot, share), shapes(robot, {})
    np.testing.assert_allclose(color(shared, "link2a")[:3], of_share(0.6))
    np.testing.assert_allclose(color(shared, "link1")[:3], of_share(0.0))
    assert not np.allclose(color(plain, "link2a"), color(shared, "link2a"))
    np.testing.assert_allclose(color(plain, "cart1"), color(shared, "cart1"))


def test_rods_without_shapes_become_cylinders_from_end_to_end():
    xml = re.sub(r"<visual.*?</visual>", "", NOMINAL.robot.description.xml, flags=re.S)
    robot = Chain(RobotDescription.parse(xml))
    found = shapes(robot, {"link1": 1.0})
    assert [shape.name for shape in found.geometryObjects] == list(robot.rod_sites)
    posture = gtpin.home(robot)
    data = robot.model.createData()
    placed = found.createData()
    pin.updateGeometryPlacements(robot.model, data, found, placed, posture.configuration)
    own = closures.nominal("gantry_tau")
    joints, seats = own.P @ posture.R.T + posture.T, own.C(robot.home_q[None])[0]
    for i, (shape, M) in enumerate(zip(found.geometryObjects, placed.oMg, strict=True)):
        half = M.rotation @ np.array([0.0, 0.0, shape.geometry.halfLength])
        both = np.array([M.translation - half, M.translation + half])
        np.testing.assert_allclose(both, np.array([joints[i], seats[i]]), atol=1e-9)


@pytest.mark.parametrize("name", ["gantry_tau", "tau", "stewart"])
def test_every_cart_or_arm_every_rod_and_the_platform_has_its_name_once_where_it_is(name):
    robot = load_robot(name)
    posture, data = gtpin.home(robot), robot.model.createData()
    pin.forwardKinematics(robot.model, data, posture.configuration)
    where = {part.name: part.place(data) for part in parts(robot)}
    assert len(parts(robot)) == len(where)
    assert set(where) == {"platform", *robot.sites, *robot.rod_sites}
    np.testing.assert_allclose(where["platform"], posture.T, atol=1e-9)
    own = closures.nominal(name)
    joints, seats = own.P @ posture.R.T + posture.T, own.C(robot.home_q[None])[0]
    for site, joint, seat in zip(robot.rod_sites, joints, seats, strict=True):
        off = where[site] - joint
        assert np.linalg.norm(np.cross(off, seat - joint)) < 1e-9  # on the rod
        assert 0.0 < off @ (seat - joint) < (seat - joint) @ (seat - joint)


@pytest.fixture
def scene(served) -> Scene:
    """A page of five poses whose ids are not their rows."""
    dataset = dataset_of(NOMINAL, np.array([1e-4, 0.0, 0.0])).take(slice(0, 5))
    return served(NOMINAL, gap_of(NOMINAL, replace(dataset, pose=["19", "32", "7", "<b>", "19b"])))


def test_the_page_tells_the_id_and_the_row_of_the_pose_that_the_slider_is_at(scene):
    for place, named in enumerate(["19 (row 2)", "32 (row 3)", "7 (row 4)", "<b> (row 5)", "19b (row 6)"], 1):
        scene.panel.place.value = place
        assert scene.panel.chosen.value == named
        assert scene.panel.message.content.startswith(f"**Pose {named.replace('<', '&lt;')}**: off by 100.0 µm")
        np.testing.assert_allclose(scene.posture.T, scene.gap.T[place - 1], atol=1e-9)


def test_a_pose_that_is_chosen_by_its_id_is_gone_to(scene):
    scene.panel.chosen.value = "7 (row 4)"
    assert scene.panel.place.value == 3
    np.testing.assert_allclose(scene.posture.T, scene.gap.T[2], atol=1e-9)


def test_poses_are_played_in_a_thread_that_lasts_as_long_as_the_box_is_ticked(scene):
    def walking():
        return [thread for thread in threading.enumerate() if thread.name == "poses played"]

    assert walking() == []
    came = threading.Event()
    scene.panel.place.on_update(lambda _: came.set())
    scene.panel.play.value = True
    assert came.wait(SLOW / 1000.0)
    assert scene.panel.index > 0
    (thread,) = walking()
    scene.panel.play.value = False
    thread.join(SLOW / 1000.0)
    assert walking() == []


def test_names_move_with_the_parts_and_can_be_hidden(scene):
    scene.show(np.array([0.2, -0.1, 0.3]))
    where = {part.name: np.array(label.position) for part, label in scene.labels.items()}
    np.testing.assert_allclose(where["platform"], scene.posture.T, atol=1e-9)
    scene.show(np.array([0.2, -0.1, 0.4]))
    moved = {
        part.name for part, label in scene.labels.items() if np.abs(label.position - where[part.name]).max() > 1e-3
    }
    assert moved >= {"platform", "cart3", "link3a", "link3b", "link3c"}
    assert not moved & {"cart1", "cart2"}
    scene.names.value = False
    assert not any(label.visible for label in scene.labels.values())


def test_a_single_pose_has_a_page_too(scene):
    from gtpin.extras.view.scene import GapPanel

    one = replace(
        scene.gap, **{k: getattr(scene.gap, k)[:1] for k in ("pose", "row", "q", "T", "error", "name", "value", "unit")}
    )
    panel = GapPanel(scene.server, "one", one, lambda _: "")
    assert "Pose 19 (row 2)" in panel.message.content
    assert panel.place.disabled


def test_the_page_shows_names_ids_and_whose_errors_they_are_in_a_browser(scene):
    with launched() as browser:
        tab = browser.new_page(viewport={"width": 1000, "height": 400})
        tab.set_default_timeout(SLOW)
        tab.goto(scene.address)
        tab.get_by_text("position errors of the nominal model, 100 µm RMS at 5 poses").wait_for()
        tab.get_by_text("Pose 19 (row 2)").wait_for()
        scene.panel.place.value = 4
        tab.get_by_text("Pose <b> (row 5)").wait_for()


def test_the_page_is_served_without_a_word_and_the_machine_goes_where_it_is_told(capsys, scene):
    with urllib.request.urlopen(scene.address, timeout=60) as page:
        assert b"<html" in page.read(2000).lower()
    scene.show(np.array([0.1, -0.2, 0.05]))
    np.testing.assert_allclose(scene.posture.T, NOMINAL.predict([[0.1, -0.2, 0.05]]).T[0], atol=1e-9)
    scene.stop()
    assert capsys.readouterr().out == ""


def test_without_the_extra_the_error_says_how_to_get_it(monkeypatch):
    from gtpin.extras.view import scene

    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(GtpinError, match=r"gtpin\[view\]"):
        scene.Scene(NOMINAL, None)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code"),
    [(["gantry_tau", "-o", "a.png"], 0), (["gantry_tau", "-o", "a.gif"], 2), (["nobody", "-o", "a.png"], 2)],
)
def test_the_command_writes_a_still_image_or_says_in_one_line_why_not(arguments, code, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["gtpin", "view", *arguments])
    with pytest.raises(SystemExit) as ended:
        gtpin.cli.main()
    out, err = capsys.readouterr()
    assert ended.value.code == code
    assert len((err if code else out).splitlines()) == 1
    assert (tmp_path / "a.png").exists() == (code == 0)
