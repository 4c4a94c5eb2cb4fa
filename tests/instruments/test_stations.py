"""A tracker with a free frame for each session: what is found of frames, geometry and target; what is refused; what is said."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from quick_first import quick_first
from scipy.stats import chi2
from virtual_stations import AXES, SIGMA, Stations, measured, written

import gtpin
from gtpin.calibration.result import Calibration
from gtpin.cli import main
from gtpin.data import InstrumentSection
from gtpin.errors import DatasetError
from gtpin.export import export

Floats = np.ndarray
PLACEMENTS = [f"placement[J{j}].{axis}" for j in range(1, 7) for axis in AXES] + [f"platform.{axis}" for axis in AXES]
MACHINES = 12
CHANCE = 1e-4
"""Chance of each end of the tests of chi-square."""


def calibrated(folder: Path) -> Calibration:
    return gtpin.calibrate(gtpin.Dataset.read(folder))


def off_frames(found: Calibration, truth: Stations, name: str = "tracker") -> Floats:
    """(6 K,) true less found frames, in the coordinates of the unknowns: shift, m, and change of the rotation vector, rad."""
    parts = []
    for session, frame in truth.frames.items():
        value = np.array([found.unknown(f"{name}.frame[{session}].{axis}").value for axis in AXES])
        R = pin.exp3(value[3:])
        turn = pin.Jlog3(R) @ pin.log3(R.T @ frame.rotation)
        parts += [frame.translation - value[:3], turn]
    return np.concatenate(parts)


def covariance_of(found: Calibration, names: list[str]) -> Floats:
    at = [[unknown.name for unknown in found.unknowns].index(name) for name in names]
    return found.u_covariance[np.ix_(at, at)]


def assert_chi2(power: float, count: int) -> None:
    assert chi2.ppf(CHANCE, count) < power < chi2.isf(CHANCE, count)


@pytest.mark.slow
@pytest.mark.parametrize(("orientations", "rows"), [(False, 30), (True, 12)])
def test_frames_and_geometry_are_within_their_sigmas_of_the_truth(
    tmp_path: Path, orientations: bool, rows: int
) -> None:
    frames, geometry, deviation = 0.0, 0.0, []
    for seed in range(MACHINES):
        truth = measured(tmp_path, 10 + seed, rows=rows, orientations=orientations)
        found = calibrated(truth.write(tmp_path / "set"))
        off = off_frames(found, truth)
        names = [f"tracker.frame[{session}].{axis}" for session in truth.frames for axis in AXES]
        frames += off @ np.linalg.solve(covariance_of(found, names), off)
        at = [found.names.index(name) for name in PLACEMENTS]
        moved = truth.errors.ravel() - found.model.geometry.deviation[at]
        geometry += moved @ np.linalg.solve(found.covariance[np.ix_(at, at)], moved)
        deviation.append(moved / np.sqrt(np.diag(found.covariance)[at]))
    assert_chi2(frames, MACHINES * 6 * 3)
    assert_chi2(geometry, MACHINES * len(PLACEMENTS))
    # Of each parameter, the mean over the machines of a normal number.
    assert np.abs(np.mean(deviation, axis=0)).max() < 4.5 / np.sqrt(MACHINES)


def test_the_result_is_that_of_one_instrument_for_each_station(tmp_path: Path) -> None:
    truth = measured(tmp_path, 1)
    one, each = calibrated(truth.write(tmp_path / "one")), calibrated(truth.write_one_each(tmp_path / "each"))
    assert one.dof == pytest.approx(each.dof, abs=1e-6)
    assert one.chi2 == pytest.approx(each.chi2, rel=1e-6)
    for name in one.names:
        assert abs(one[name].value - each[name].value) < 1e-4 * one[name].sigma
        assert one[name].sigma == pytest.approx(each[name].sigma, rel=1e-6)
    for session in truth.frames:
        for axis in AXES:
            a, b = one.unknown(f"tracker.frame[{session}].{axis}"), each.unknown(f"of_{session}.frame.{axis}")
            assert abs(a.value - b.value) < 1e-4 * a.sigma
            assert a.sigma == pytest.approx(b.sigma, rel=1e-6)


@pytest.mark.parametrize("orientations", [False, True])
def test_one_target_is_found_for_all_stations(tmp_path: Path, orientations: bool) -> None:
    """With few poses from each station, of which none would find it by itself."""
    truth = measured(tmp_path, 2, stations=6, rows=8, target=True, orientations=orientations)
    found = calibrated(truth.write(tmp_path / "set", target="free"))
    assert found.chi2 / found.dof < 1.6
    names = [f"tracker.target.{axis}" for axis in AXES[: 6 if orientations else 3]]
    assert [unknown.name for unknown in found.unknowns if ".target" in unknown.name] == names
    for name, at in zip(names[:3], (pin.exp6(truth.errors[6]) * truth.target).translation, strict=True):
        # The tool's own place has its tolerance, which the target's takes up.
        assert abs(found.unknown(name).value - at) < 4.0 * np.hypot(found.unknown(name).sigma, 5e-4)
    off = off_frames(found, truth)
    frames = [f"tracker.frame[{session}].{axis}" for session in truth.frames for axis in AXES]
    assert off @ np.linalg.solve(covariance_of(found, frames), off) < chi2.isf(CHANCE, len(off))


@pytest.mark.filterwarnings("ignore:robot.urdf:gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("free", [True, False])
def test_the_exported_urdf_has_a_link_where_the_target_was_measured(tmp_path: Path, free: bool) -> None:
    """Pinocchio's placement of this link, seen from the station, is what was read, to the noise."""
    truth = measured(tmp_path, 6, target=True)
    place = "free" if free else truth.target.translation.tolist()
    found = calibrated(truth.write_second(tmp_path / "set", target=place))
    export(found.model, tmp_path / "robot.urdf")
    model = pin.buildModelFromUrdf(str(tmp_path / "robot.urdf"))
    data, link, power = model.createData(), model.getFrameId("target"), 0.0
    for q, session, read in zip(truth.q, truth.session, truth.T, strict=True):
        pin.framesForwardKinematics(model, data, q)
        x = np.array([found.unknown(f"laser.frame[{session}].{axis}").value for axis in AXES])
        power += ((read - x[:3] - pin.exp3(x[3:]) @ data.oMf[link].translation) ** 2).sum() / SIGMA**2
    assert power < chi2.isf(CHANCE, 3 * len(truth.q))


@pytest.mark.parametrize("how", quick_first(["write_one_each", "write", "write_second"]))
def test_the_tool_has_no_correction_where_the_place_of_a_target_was_unknown(tmp_path: Path, how: str) -> None:
    """Whatever describes the stations. Where the place was declared, the tool has its six rows, and nothing is assumed."""
    truth = measured(tmp_path, 6, target=True)
    for name, place in (("free", "free"), ("known", truth.target.translation.tolist())):
        if how == "write" and name == "known":
            continue  # schema 1 can't say it
        model = calibrated(getattr(truth, how)(tmp_path / f"{name}_set", target=place)).model
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            export(model, tmp_path / f"{name}.urdf")
            export(model, tmp_path / f"{name}.csv", "dh")
        words = "\n".join(str(warning.message) for warning in said)
        assert ("has the tool, tool0, where the robot's own file has it" in words) is (name == "free")
        assert "is in the base frame, as the tolerances give it" in words  # the frames were free
        rows = (tmp_path / f"{name}.csv").read_text(encoding="utf-8").splitlines()
        assert sum(row.startswith("tool,") for row in rows) == (0 if name == "free" else 6)


def test_both_schemas_and_python_say_the_same(tmp_path: Path) -> None:
    truth = measured(tmp_path, 3, orientations=True)
    first, second = (
        gtpin.Dataset.read(truth.write(tmp_path / "1")),
        gtpin.Dataset.read(truth.write_second(tmp_path / "2")),
    )
    said = InstrumentSection(position_sigma=SIGMA, orientation_sigma=1e-4, stations="session")
    own = {"session": np.array(truth.session, dtype=object)}
    names = [f"p{i}" for i in range(len(truth.q))]
    python = gtpin.Dataset(str(truth.urdf), names, truth.q, truth.T, truth.wxyz, covariates=own, instrument=said)
    first.write(tmp_path / "again")
    values = [gtpin.calibrate(d) for d in (first, second, python, gtpin.Dataset.read(tmp_path / "again"))]
    for other in values[1:]:
        np.testing.assert_allclose(other.u, values[0].u, rtol=0, atol=1e-12)
        np.testing.assert_allclose(other.model.geometry.values, values[0].model.geometry.values, rtol=0, atol=1e-12)
    assert [u.name for u in values[1].unknowns] == [u.name.replace("tracker", "laser") for u in values[0].unknowns]


@pytest.mark.slow
def test_the_order_of_rows_and_the_names_of_sessions_change_nothing_else(tmp_path: Path) -> None:
    truth = measured(tmp_path, 4, stations=4, rows=15, target=True)
    plain = gtpin.Dataset.read(truth.write(tmp_path / "set", target="free"))
    whole = gtpin.calibrate(plain)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(plain))
        new = dict(zip(truth.frames, rng.permutation(["Z", "10", "a b", "S1"]), strict=True))
        sessions = np.array([new[name] for name in plain.covariates["session"]], dtype=object)
        found = gtpin.calibrate(replace(plain, covariates={"session": sessions}).take(order))
        assert abs(found.chi2 - whole.chi2) < 1e-6 * whole.chi2
        for name in whole.names:
            assert abs(found[name].value - whole[name].value) < 1e-3 * whole[name].sigma
        for session, other in new.items():
            for axis in AXES:
                a, b = (
                    whole.unknown(f"tracker.frame[{session}].{axis}"),
                    found.unknown(f"tracker.frame[{other}].{axis}"),
                )
                assert abs(a.value - b.value) < 1e-3 * a.sigma


def test_a_station_with_two_poses_more_tells_no_less(tmp_path: Path) -> None:
    """Its three positions take six numbers for their frame, and leave three."""
    truth = measured(tmp_path, 5, stations=4, rows=25)
    few = replace(truth, session=["S4" if s == "S4" else "S1" for s in truth.session])
    kept = [i for i, s in enumerate(truth.session) if s in ("S1", "S2", "S3")] + [75, 76, 77]
    part = replace(few, session=[truth.session[i] for i in kept], q=truth.q[kept], T=truth.T[kept])
    without = replace(part, session=part.session[:-3], q=part.q[:-3], T=part.T[:-3])
    more, less = calibrated(part.write(tmp_path / "more")), calibrated(without.write(tmp_path / "less"))
    assert more.dof - less.dof == pytest.approx(3.0, abs=0.2)
    assert all(more[name].sigma <= less[name].sigma * (1.0 + 1e-6) for name in more.names) or more.sigma_scale > 1.0


REFUSED: dict[str, tuple[Callable[[Stations], Stations], dict[str, object], str, str]] = {
    "no session": (lambda t: t, {}, 'stations = "session" without sessions', "session"),
    "one pose": (lambda t: replace(t, session=["X", *t.session[1:]]), {}, "session X has 1 different pose", "session"),
    "two positions": (
        lambda t: replace(t, session=["X", "X", *t.session[2:]]),
        {},
        "session X has 2 different poses",
        "session",
    ),
    "a visit again": (
        lambda t: replace(t, session=["X"] * 4 + t.session[4:], q=np.vstack([t.q[[0]] * np.ones((4, 1)), t.q[4:]])),
        {},
        "session X has 1 different pose",
        "session",
    ),
    "wrong value": (lambda t: t, {"stations": "day"}, "'day' can't be", "instrument.stations"),
    "in the base frame": (lambda t: t, {"frame": "robot"}, "stations have free frames", "instrument.frame"),
    "a station": (lambda t: t, {"station": [1.0, 2.0, 0.5]}, "station together with stations", "instrument.station"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_has_no_frames_is_refused_with_the_place(tmp_path: Path, what: str) -> None:
    change, said, message, column = REFUSED[what]
    truth = change(measured(tmp_path, 6, rows=10))
    folder = truth.write(tmp_path / "set", **said)
    if what == "no session":
        table = folder / "poses.csv"
        table.write_text("\n".join(line.rpartition(",")[0] for line in table.read_text().splitlines()))
    with pytest.raises(DatasetError, match=re.escape(message)) as caught:
        gtpin.calibrate(gtpin.Dataset.read(folder))
    assert caught.value.column == column
    assert caught.value.hint


def test_a_free_frame_is_what_stations_have_anyway(tmp_path: Path) -> None:
    truth = measured(tmp_path, 6, rows=10)
    one, other = (gtpin.Dataset.read(truth.write(tmp_path / str(name), frame=name)) for name in ("free", None))
    assert one.readings.tables == other.readings.tables


@pytest.mark.slow
def test_millimetres_are_named(tmp_path: Path) -> None:
    truth = measured(tmp_path, 7)
    with pytest.raises(DatasetError, match="x y z look like millimetres") as caught:
        calibrated(replace(truth, T=1e3 * truth.T).write(tmp_path / "set"))
    assert "multiply by 0.001" in caught.value.hint


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_effects_that_the_frames_absorb_say_so_and_what_is_left_is_found(tmp_path: Path) -> None:
    """The first joint's zero turns the whole arm about its base, as a frame does; the third's does not."""
    truth = measured(tmp_path, 8, stations=4, rows=40)
    later = np.array(truth.session) == "S3"
    commands = truth.q - np.outer(later, [1e-3, 0.0, 1e-3, 0.0, 0.0, 0.0])  # what is commanded for what is reached
    found = gtpin.diagnose(gtpin.Dataset.read(replace(truth, q=commands).write(tmp_path / "set")))
    assert [(cause.effect, cause.site) for cause in found.causes] == [("zero_shift", "J3")]
    reasons = {(c.effect, c.site): c.reason.kind for c in found.candidates if c.reason is not None}
    assert reasons["frame_shift", "frame"] == reasons["zero_shift", "J1"] == "stations"
    assert ("zero_shift", "J3") not in reasons
    said = {(c["effect"], c["site"]): c["reason"] for c in found.to_json()["candidates"]}
    assert said["frame_shift", "frame"] == "the free frame of each session absorbs it (stations in dataset.toml)"


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_what_the_causes_explain_is_not_said_to_be_left_of_the_model(tmp_path: Path) -> None:
    """The third joint errs four times a turn: geometry alone leaves that, and geometry with the cause only noise."""
    truth = measured(tmp_path, 9, stations=2, rows=60)
    periodic = 3e-4 * np.sin(4.0 * truth.q[:, 2] + 0.5)
    commands = truth.q - np.outer(periodic, np.eye(6)[2])
    found = gtpin.diagnose(gtpin.Dataset.read(replace(truth, q=commands).write(tmp_path / "set")))
    assert {cause.site for cause in found.causes} == {"J3"}
    assert found.baseline.model.unexplained is not None
    assert found.baseline.model.unexplained.position > 5e-5
    assert found.model.unexplained is not None
    assert found.model.unexplained.none


def test_each_row_is_predicted_in_the_frame_of_its_session_and_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(*words: object) -> int:
        monkeypatch.setattr(sys, "argv", ["gtpin", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0)

    truth = measured(tmp_path, 9, orientations=True)
    data, model, out = truth.write(tmp_path / "set"), tmp_path / "model", tmp_path / "out.csv"
    assert run("calibrate", data, "-o", model) == 0
    commands = tmp_path / "commands.csv"
    head, *rows = (data / "poses.csv").read_text().splitlines()
    keep = [0, *range(1, 7), head.split(",").index("session")]

    def asked(*lines: str) -> int:
        commands.write_text("\n".join(",".join(line.split(",")[i] for i in keep) for line in (head, *lines)))
        capsys.readouterr()
        return run("predict", model, commands, "-o", out, "--force")

    assert asked(*rows[::-1]) == 0
    names, *lines = (line.split(",") for line in out.read_text().splitlines())
    assert names == ["pose", "session", "x", "y", "z", "qw", "qx", "qy", "qz"]
    T = np.array([line[2:5] for line in lines], dtype=float)[::-1]
    assert np.sqrt(((T - truth.T) ** 2).mean()) < 1.2 * SIGMA
    assert asked(rows[0], rows[1].replace(",S1", ",S9")) == 2
    error = capsys.readouterr().err
    assert "commands.csv, row 3, column session" in error
    assert "no frame is known of a station in session S9" in error
    assert "S1, S2, S3" in error
    keep.pop()
    assert asked(rows[0]) == 2
    assert "column session: which station?" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("hold_out", ["region", "session"])
def test_the_gap_is_the_noise_s_whatever_is_left_out(tmp_path: Path, hold_out: str) -> None:
    """What is left out of a whole session is without what its frame takes up."""
    truth = measured(tmp_path, 10, stations=4, rows=40)
    found = gtpin.diagnose(gtpin.Dataset.read(truth.write(tmp_path / "set")), hold_out=hold_out)
    (own,) = found.gap.by_instrument
    assert found.verdict == "none"
    assert own.before == pytest.approx(np.sqrt(3.0) * SIGMA, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("same_stops", [True, False])
@pytest.mark.filterwarnings("ignore:.*covariates that only some tables have")
def test_a_tilt_sensor_on_a_link_beside_it_has_no_stations_and_tells_of_the_geometry(
    tmp_path: Path, same_stops: bool
) -> None:
    truth, rng = measured(tmp_path, 11, stations=5), np.random.default_rng(0)
    model = pin.buildModelFromUrdf(str(truth.urdf))
    for joint in range(1, 7):
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(truth.errors[joint - 1])
    data, tilts = model.createData(), np.empty((len(truth.q), 2))
    for i, row in enumerate(truth.q):
        pin.framesForwardKinematics(model, data, row)
        tilts[i] = data.oMf[model.getFrameId("link2")].rotation[2, :2] + rng.normal(0.0, 5e-5, 2)
    level = {name: truth.columns[name] for name in ("pose", *(f"q{j}" for j in range(1, 7)))}
    level |= {"tilt_x": list(tilts[:, 0]), "tilt_y": list(tilts[:, 1])}
    if not same_stops:
        level["pose"] = [f"t{i}" for i in range(len(tilts))]
    instruments = [
        {"name": "laser", "kind": "tracker", "stations": "session", "position_sigma": SIGMA},
        {"name": "level", "kind": "tilt", "link": "link2", "sigma": 5e-5},
    ]
    toml = {"schema": "gtpin-dataset/2", "robot": str(truth.urdf), "instrument": instruments}
    both = calibrated(written(tmp_path / "both", toml, {"laser": truth.columns, "level": level}))
    alone = calibrated(truth.write(tmp_path / "alone"))
    at = [both.names.index(name) for name in PLACEMENTS]
    off = truth.errors.ravel() - both.model.geometry.deviation[at]
    assert off @ np.linalg.solve(both.covariance[np.ix_(at, at)], off) < chi2.isf(CHANCE, len(at))
    shares = [both[name].sigma / alone[name].sigma for name in PLACEMENTS]
    assert min(shares) < 0.9
    assert max(shares) < 1.0 + 1e-6
