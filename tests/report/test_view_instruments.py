"""Instruments in 3-D: where they are drawn is where the model reads from, and what is on the platform moves with it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from known_readings import NOMINAL, S1, S2, STATION, TARGET, commands, write

import gtpin
import gtpin.cli
from gtpin.data import Dataset
from gtpin.data.instrument_tables import PlaneTable, RangeTable, SocketTable, TiltTable, TrackerTable
from gtpin.errors import ModelError
from gtpin.extras.view.gap import DrawnGap, gap_with_instruments
from gtpin.extras.view.still import still
from gtpin.instruments import Plane, Range, Socket, Tilt, Tracker
from gtpin.instruments.instrument import Instrument, Read
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp
from gtpin.model.model import FittedInstrument
from gtpin.report.instrument_places import InstrumentPlaces, patch
from gtpin.report.skeleton import skeleton

if TYPE_CHECKING:
    from gtpin.extras.view.scene import Scene

Shown = tuple[DrawnGap, tuple[FittedInstrument, ...]]
ROBOT, UP = gtpin.load_robot("gantry_tau"), np.array([0.0, 0.0, 1.0])


def fitted(table: object, seed: int = 1, **ids: tuple[str, ...]) -> tuple[FittedInstrument, Instrument, np.ndarray]:
    """An instrument whose unknowns are off by hundredths, and the one that reads with them, of a single row."""
    kinds = {"range": Range, "plane": Plane, "socket": Socket, "tilt": Tilt, "tracker": Tracker}
    numbers = {name: np.ones(1) for name in table.numbers}  # type: ignore[attr-defined]
    columns = {name: np.array([known[0]], dtype=object) for name, known in ids.items()}
    read = Read(numbers, columns, np.array([-1]), ids)
    one = kinds[table.kind](table, read, ROBOT)  # type: ignore[attr-defined]
    u = np.random.default_rng(seed).normal(0.0, 0.03, len(one.unknowns))
    values = {unknown.name: float(v) for unknown, v in zip(one.unknowns, u, strict=True)}
    return FittedInstrument(table, (), ids, values), one, u  # type: ignore[arg-type]


def pose_with_target_at(at: np.ndarray, target: np.ndarray) -> Poses:
    R = exp(np.array([0.1, -0.2, 0.3]))
    return Poses((at - R @ target)[None], R[None])


def test_a_range_is_the_distance_from_the_drawn_station_to_the_drawn_target() -> None:
    table = RangeTable(name="w", kind="range", stations={"A": (1.0, 2.0, 3.0), "B": (0.0, 1.0, 0.0)}, target_sigma=1e-3)
    drawn, one, u = fitted(table, station=("B", "A"))
    places = InstrumentPlaces.of([drawn])
    assert set(places.stations) == {"w A", "w B"}
    assert places.wires == [("w A", "w"), ("w B", "w")]
    pose = pose_with_target_at(np.array([0.5, 0.5, 0.5]), np.zeros(3))
    end = pose.T[0] + pose.R[0] @ places.targets["w"]
    assert one.predicted(pose, u)[0, 0] == pytest.approx(np.linalg.norm(end - places.stations["w B"]), abs=1e-12)


def test_a_target_on_the_drawn_plane_touches_it_and_one_along_the_normal_is_above() -> None:
    planes = {"bed": {"point": (0.1, 0.2, 0.3), "normal": (0.1, 0.2, 2.0)}}
    drawn, one, u = fitted(PlaneTable(name="p", kind="plane", planes=planes, target=(0.01, 0.02, 0.03)), plane=("bed",))
    ((point, normal),) = InstrumentPlaces.of([drawn]).planes.values()
    corners = patch(point, normal, 0.2)
    assert np.linalg.norm(corners[0] - corners[1]) == pytest.approx(0.4)
    for at in corners:
        height = one.predicted(pose_with_target_at(at, np.array([0.01, 0.02, 0.03])), u)[0, 0]
        assert height == pytest.approx(0.0, abs=1e-12)
    above = pose_with_target_at(point + 0.07 * normal, np.array([0.01, 0.02, 0.03]))
    assert one.predicted(above, u)[0, 0] == pytest.approx(0.07, abs=1e-12)
    assert np.cross(corners[1] - corners[0], corners[2] - corners[1]) @ normal == pytest.approx(0.16)


@pytest.mark.parametrize("declared", [True, False])
def test_a_target_at_the_drawn_socket_sits_in_it(declared: bool) -> None:
    sockets = {"S1": (1.0, 0.0, 0.2)} if declared else {}
    table = SocketTable(name="cup", kind="socket", sockets=sockets, socket_sigma=1e-2 if declared else None)
    drawn, one, u = fitted(table, socket=("S1",))
    (at,) = InstrumentPlaces.of([drawn]).sockets.values()
    np.testing.assert_allclose(one.predicted(pose_with_target_at(at, np.zeros(3)), u)[0, :3], 0.0, atol=1e-12)


def test_a_free_tracker_reads_zero_where_it_is_drawn() -> None:
    drawn, one, u = fitted(TrackerTable(name="cam", kind="tracker", frame="free"))
    (at,) = InstrumentPlaces.of([drawn]).stations.values()
    np.testing.assert_allclose(one.predicted(pose_with_target_at(at, np.zeros(3)), u)[0], 0.0, atol=1e-12)


def test_a_tilt_sensor_reads_along_its_drawn_axes() -> None:
    drawn, one, u = fitted(TiltTable(name="level", kind="tilt"))
    places = InstrumentPlaces.of([drawn])
    pose = pose_with_target_at(np.zeros(3), np.zeros(3))
    axes = pose.R[0] @ places.tilts["level"]
    np.testing.assert_allclose(one.predicted(pose, u)[0], axes[:, :2].T @ UP, atol=1e-12)
    assert not places.targets


def test_without_instruments_nothing_is_drawn() -> None:
    assert not InstrumentPlaces.of([])


@pytest.fixture
def shown(tmp_path: Path) -> Shown:
    """The nominal model's gap at a wire, a cup and a level; of the level only the mounting is not known."""
    write(tmp_path)
    return gap_with_instruments(NOMINAL, Dataset.read(tmp_path))


def test_errors_of_readings_are_along_what_is_read(shown: Shown) -> None:
    gap, instruments = shown
    places = InstrumentPlaces.of(instruments)
    assert len(gap.q) == 20 + 16 + 12
    for i in range(len(gap.q)):
        pose = NOMINAL.kinematics.forward(gap.q[i : i + 1])
        if gap.name[i] == "wire":
            target = pose.T[0] + pose.R[0] @ TARGET
            np.testing.assert_allclose(gap.T[i], target, atol=1e-12)
            sight = target - places.stations["wire"]
            np.testing.assert_allclose(np.cross(gap.error[i], sight), 0.0, atol=1e-15)
            assert gap.length[i] == pytest.approx(gap.value[i])
            assert gap.whitened[i] == pytest.approx(gap.value[i] / 2e-5)
        elif gap.name[i] == "cup":
            socket = places.sockets["cup S1" if i < 28 else "cup S2"]
            np.testing.assert_allclose(gap.T[i] + gap.error[i], socket, atol=1e-12)
        else:
            assert gap.length[i] == 0.0
            assert gap.said(i).startswith("level off by ")
            assert gap.said(i).endswith("rad")


def test_the_gap_names_each_instrument_and_the_model(shown: Shown) -> None:
    gap, _ = shown
    assert gap.what == "reading errors of the nominal model"
    assert all(f"{name} " in gap.summary for name in ("wire", "cup", "level"))
    assert gap.summary.endswith("RMS at 48 readings")
    assert gap.magnification() >= 1.0


def test_a_model_of_other_instruments_is_refused(tmp_path: Path) -> None:
    write(tmp_path)
    other, _, _ = fitted(TiltTable(name="other", kind="tilt"))
    with pytest.raises(ModelError, match=r"does not know wire\.station\[A\]\.x"):
        gap_with_instruments(replace(NOMINAL, instruments=(other,)), Dataset.read(tmp_path))


def test_a_still_image_names_stations_sockets_and_known_distances(shown: Shown) -> None:
    (axes,) = still(NOMINAL, *shown).axes
    told = [text.get_text().strip() for text in axes.texts]
    assert {"wire", "cup S1", "cup S2", "100.1 mm"} <= set(told)
    assert "reading errors of the nominal model" in axes.get_title()


def test_without_a_gap_wires_end_at_the_drawn_platform(shown: Shown) -> None:
    (axes,) = still(replace(NOMINAL, instruments=shown[1])).axes
    machine = skeleton(NOMINAL)
    assert machine is not None
    (wire,) = [line for line in axes.lines if line.get_linestyle() == "--"]
    end = np.array(wire.get_data_3d())[:, 1]
    assert np.linalg.norm(end - machine.tcp) == pytest.approx(np.linalg.norm(TARGET), abs=1e-9)


@pytest.mark.slow
def test_the_command_writes_a_picture_of_readings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "data").mkdir()
    write(tmp_path / "data")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["gtpin", "view", "gantry_tau", "data", "-o", "gap.png"])
    with pytest.raises(SystemExit) as ended:
        gtpin.cli.main()
    assert ended.value.code == 0
    assert (tmp_path / "gap.png").read_bytes().startswith(b"\x89PNG")


@pytest.fixture
def scene(shown: Shown, served: Callable[..., Scene]) -> Scene:
    planes = {"bed": {"point": (-1.3, -4.3, 0.0), "normal": (0.0, 0.0, 1.0)}}
    bed = FittedInstrument(PlaneTable(name="bed", kind="plane", planes=planes))
    return served(NOMINAL, shown[0], instruments=(*shown[1], bed))


def test_wires_go_from_stations_to_targets_and_the_tilt_sensor_follows_the_platform(scene: Scene) -> None:
    assert scene.instruments is not None
    station = scene.instruments.places.stations["wire"]
    np.testing.assert_allclose(station, STATION, atol=0.1)
    for q in commands(3, 5):
        scene.show(q)
        ((start, end),) = scene.instruments.drawn["/instruments/wires"].points
        pose = NOMINAL.kinematics.forward(q[None])
        np.testing.assert_allclose(start, station, atol=1e-6)
        np.testing.assert_allclose(end, pose.T[0] + pose.R[0] @ TARGET, atol=1e-6)
        np.testing.assert_allclose(scene.instruments.drawn["/instruments/tilts/level"].position, pose.T[0], atol=1e-6)


def test_sockets_planes_and_their_names_are_in_the_scene_and_names_can_be_hidden(scene: Scene) -> None:
    assert scene.instruments is not None
    drawn = scene.instruments.drawn
    for name, at in (("cup S1", S1), ("cup S2", S2)):
        np.testing.assert_allclose(
            drawn[f"/instruments/sockets/{name}"].position, scene.instruments.places.sockets[name], atol=1e-9
        )
        np.testing.assert_allclose(scene.instruments.places.sockets[name], at, atol=0.5)
    corners = drawn["/instruments/planes/bed"].vertices
    np.testing.assert_allclose(corners[:, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(corners.mean(axis=0), [-1.3, -4.3, 0.0], atol=1e-6)
    normal = drawn["/instruments/planes/bed/normal"].points[0]
    assert (normal[1] - normal[0])[2] > 0.0
    assert {label.text for label in scene.instruments.labels} == {"wire", "cup S1", "cup S2", "100.1 mm", "bed"}
    scene.names.value = False
    assert not any(label.visible for label in scene.instruments.labels)


def test_the_page_tells_which_instrument_is_off_and_by_how_much(scene: Scene) -> None:
    assert scene.panel is not None
    assert len(set(scene.panel.names)) == 48
    scene.panel.place.value = 3
    assert scene.panel.message.content.startswith("**Pose w2 (wire row 4)**: wire off by ")
    scene.panel.place.value = 48
    assert scene.panel.message.content.startswith("**Pose t11 (level row 13)**: level off by ")


def test_a_model_with_instruments_is_shown_with_them(shown: Shown, served: Callable[..., Scene]) -> None:
    instruments = served(replace(NOMINAL, instruments=shown[1])).instruments
    assert instruments is not None
    assert "/instruments/stations/wire" in instruments.drawn
    assert served(NOMINAL).instruments is None
