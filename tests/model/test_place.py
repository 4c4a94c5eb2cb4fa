"""Where a machine stands is no part of its stated errors, as far as no instrument shows it, of all instruments together."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.accuracy.expected import Uncertainty, response
from gtpin.data import InstrumentSection
from gtpin.data.instrument_tables import (
    EncoderTable,
    InstrumentTable,
    PlaneTable,
    RangeTable,
    SocketTable,
    TiltTable,
    TrackerTable,
)
from gtpin.model.departures import departures
from gtpin.model.model import FittedInstrument
from gtpin.model.place import free_motions, without_place
from gtpin.report.geometry import geometry_line

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
DELTA = gtpin.read_model("linear_delta")
BED = {"bed": {"point": [0.1, -0.2, 0.3], "normal": [0.0, 0.0, 1.0]}}
POINTS = {"A": [0.5, 0.0, 0.1], "B": [-0.5, 0.2, 0.4], "C": [0.0, 0.6, 0.2]}
SEEN = TrackerTable(name="laser", kind="tracker", frame="free")
LEVEL, UPRIGHT = np.eye(6)[:, [0, 1, 5]], np.eye(6)[:, [0, 1, 2, 5]]


def plane(shift: float, tilt: float) -> InstrumentTable:
    return PlaneTable(name="bed", kind="plane", planes=BED, plane_sigma=shift, normal_sigma=tilt)


def wires(sigma: float) -> InstrumentTable:
    return RangeTable(name="wire", kind="range", stations=POINTS, station_sigma=sigma)


class Own(InstrumentTable):
    """An instrument of a user, of whose place nothing is said."""


@pytest.mark.parametrize(
    ("tables", "free"),
    [
        ([SEEN], np.eye(6)),
        ([EncoderTable(name="elbow", kind="encoder", joint="elbow")], np.eye(6)),
        ([SocketTable(name="ball", kind="socket")], np.eye(6)),
        ([SEEN, plane(5e-3, 5e-3)], np.eye(6)),
        ([SEEN, wires(0.02)], np.eye(6)),
        ([SEEN, plane(1e-6, 1e-6)], LEVEL),
        ([plane(0.0, 0.0)], LEVEL),
        ([SEEN, TiltTable(name="level", kind="tilt", mount_sigma=1e-6)], UPRIGHT),
        ([SEEN, wires(1e-6)], np.zeros((6, 0))),
        ([SEEN, SocketTable(name="ball", kind="socket", sockets=POINTS, socket_sigma=1e-5)], np.zeros((6, 0))),
        ([SEEN, TrackerTable(name="other", kind="tracker", frame="robot")], np.zeros((6, 0))),
        ([SEEN, Own(name="string", kind="string")], np.zeros((6, 0))),
        ([], np.zeros((6, 0))),
    ],
    ids=lambda value: " and ".join(one.name for one in value) if isinstance(value, list) else "",
)
def test_a_motion_is_free_where_no_place_is_declared_better_than_the_tolerances_know_it(tables, free) -> None:
    model = gtpin.Model(DELTA.geometry, instruments=tuple(FittedInstrument(table) for table in tables))
    found = free_motions(model)
    assert found.shape == free.shape
    if free.shape[1]:  # they span the same space
        outside = found - free @ np.linalg.lstsq(free, found, rcond=None)[0]
        np.testing.assert_allclose(outside / np.linalg.norm(found, axis=0), 0.0, atol=0.02)


def test_parameters_that_can_not_move_the_machine_leave_a_free_tracker_s_place_free() -> None:
    held = DELTA.geometry.holding({name: DELTA.geometry[name] for name in DELTA.geometry.names if "cart" in name})
    for tables, count in (([SEEN], 6), ([SEEN, plane(5e-3, 5e-3)], 6), ([TrackerTable(name="t", kind="tracker")], 0)):
        model = gtpin.Model(held, instruments=tuple(FittedInstrument(table) for table in tables))
        assert free_motions(model).shape[1] == count


def rigid_fit(moved: np.ndarray, T: np.ndarray) -> np.ndarray:
    """(N, 3) the errors of points after the rotation and shift that fit them best."""
    turn, _ = Rotation.align_vectors(T - T.mean(axis=0), moved - moved.mean(axis=0))
    return turn.apply(moved - moved.mean(axis=0)) - (T - T.mean(axis=0))


def test_what_is_left_is_what_the_best_rigid_fit_leaves() -> None:
    rng = np.random.default_rng(1)
    T = rng.uniform(-0.5, 0.5, (60, 3)) + np.array([0.0, 0.0, 1.0])
    shape = 1e-5 * rng.standard_normal((60, 3))
    moved = Rotation.from_rotvec([2e-5, -1e-5, 3e-5]).apply(T) + np.array([1e-3, 2e-3, -1e-3]) + shape
    np.testing.assert_allclose(without_place(moved - T, T, np.eye(6)), rigid_fit(moved, T), atol=2e-8)
    np.testing.assert_array_equal(without_place(moved - T, T, np.zeros((6, 0))), moved - T)


def measured(folder: Path, rng: np.random.Generator, *, bed: bool) -> tuple[gtpin.Model, gtpin.Dataset]:
    """A machine from the tolerances, seen by a tracker that stands anywhere, and by touches of a bed that lies somewhere."""
    geometry = DELTA.geometry
    off = geometry.tolerance * rng.standard_normal(len(geometry.names))
    truth = gtpin.Model(geometry.with_values(geometry.values + off))
    q = DELTA.robot.home_q + rng.uniform(-0.15, 0.15, (60, 3))
    seen = Rotation.from_rotvec([0.1, -0.2, 0.7]).apply(truth.predict(q).T) + np.array([1.0, 2.0, 0.5])
    seen += 2e-5 * rng.standard_normal((60, 3))
    numbers = {f"q{i + 1}": q[:, i] for i in range(3)} | dict(zip("xyz", seen.T, strict=True))
    pd.DataFrame({"pose": range(60), **numbers}).to_csv(folder / "laser.csv", index=False)
    text = 'schema = "gtpin-dataset/2"\nrobot = "linear_delta"\n[[instrument]]\nname = "laser"\nkind = "tracker"\n'
    text += 'frame = "free"\nposition_sigma = 2e-5\n'
    if bed:
        normal = np.array([2e-3, -1e-3, 1.0]) / np.linalg.norm([2e-3, -1e-3, 1.0])
        q = DELTA.robot.home_q + rng.uniform(-0.15, 0.15, (40, 3))
        height = (truth.predict(q).T - [0.0, 0.0, 0.301]) @ normal + 1e-5 * rng.standard_normal(40)
        rows = {"pose": range(100, 140), **{f"q{i + 1}": q[:, i] for i in range(3)}, "height": height}
        pd.DataFrame(rows).to_csv(folder / "bed.csv", index=False)
        text += '[[instrument]]\nname = "bed"\nkind = "plane"\nsigma = 1e-5\n'
        text += "planes = {bed = {point = [0, 0, 0.3], normal = [0, 0, 1]}}\n"
    (folder / "dataset.toml").write_text(text)
    return truth, gtpin.Dataset.read(folder)


@pytest.mark.slow
def test_a_bed_beside_a_free_tracker_does_not_make_the_stated_error_larger_and_it_is_that_after_a_rigid_fit(tmp_path):
    truth, said, alone = [], [], []
    for seed in range(10):
        for bed, kept in ((False, alone), (True, said)):
            folder = tmp_path / f"{seed}{bed}"
            folder.mkdir()
            machine, data = measured(folder, np.random.default_rng([seed, 7]), bed=bed)
            model = gtpin.calibrate(data).model
            q = DELTA.robot.home_q + np.random.default_rng(seed).uniform(-0.25, 0.25, (100, 3))
            fixed = response(model, q, Uncertainty(model.covariance)).fixed[:, :3]
            kept.append(float((fixed**2).sum() / len(q)))
        off = rigid_fit(model.kinematics.forward(q).T, machine.predict(q).T)
        truth.append(float((off**2).sum(axis=1).mean()))
    assert np.mean(said) < 1.1 * np.mean(alone)
    # The mean square of ten machines, each with ten or more directions that are open, is known to a third.
    assert np.mean(truth) == pytest.approx(np.mean(said), rel=0.5)


@pytest.mark.parametrize(("frame", "common"), [("free", True), ("robot", False)])
def test_a_first_screen_says_that_a_common_tilt_of_all_tracks_is_not_determined_where_it_is_not(frame, common) -> None:
    geometry, rng, lean = DELTA.geometry, np.random.default_rng(2), 6e-3
    tracks = [name for name in geometry.names if name.startswith("track_direction") and name.endswith(".a")]
    truth = gtpin.Model(geometry.with_values(geometry.values + lean * (np.array(geometry.names) == tracks[1])))
    q = DELTA.robot.home_q + rng.uniform(-0.2, 0.2, (80, 3))
    T = truth.predict(q).T + 2e-5 * rng.standard_normal((80, 3))
    ids = [str(i) for i in range(80)]
    given = InstrumentSection(frame=frame, position_sigma=2e-5)
    found = departures(gtpin.calibrate(gtpin.Dataset("linear_delta", ids, q, T, instrument=given)).model, q)
    assert ("A common tilt of all tracks is not determined" in geometry_line(found, (), "TCP")) is common
    one = {departure.name: departure for departure in found}
    assert one[tracks[1]].value - one[tracks[0]].value == pytest.approx(lean, rel=0.25)
