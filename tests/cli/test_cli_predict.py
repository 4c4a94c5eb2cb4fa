"""``gtpin predict``: covariates reach a model's effects, ids of stations the instruments; what is wrong is said by name."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import closures
import numpy as np
import pandas as pd
import pinocchio as pin
import pytest
from by_pinocchio import placed
from ran import refused
from scipy.spatial.transform import Rotation
from with_effects import active

import gtpin
from gtpin.bench.simulator.instruments.build import simulate_measured
from gtpin.data import Commands, Dataset

COUNT = 30
PLACES = (("zero_shift", "cart1"), ("frame_shift", "frame"), ("link_compliance", "arm"))


@pytest.fixture(scope="module")
def model():
    """The nominal robot with three effects, as if fitted to sessions 1, 2 and 3."""
    rng, plain = np.random.default_rng(2), gtpin.read_model("gantry_tau")
    q, session = rng.uniform(-0.3, 0.3, (COUNT, 3)), np.array([str(1 + i % 3) for i in range(COUNT)], dtype=object)
    told = {"session": session, "payload": rng.uniform(0, 20, COUNT)}

    def drawn(sigma):
        return sigma * (1.0 + rng.standard_normal(len(sigma)))

    return replace(plain, effects=tuple(active(plain, q, *at, covariates=told, drawn=drawn) for at in PLACES))


@pytest.fixture
def folder(model, tmp_path):
    """The model's folder, with a table of commands beside it."""
    gtpin.write_model(model, tmp_path / "model")
    write(tmp_path / "c.csv")
    return tmp_path


def write(file, **columns):
    rows = {"pose": ["a", "b", "c"], "q1": [0.1, 0.0, -0.1], "q2": [0.2, 0.0, 0.1], "q3": [0.0, 0.1, 0.2]}
    rows |= {"session": [1, 2.0, "3"], "payload": [0.0, 10.0, 20.0]} | columns
    pd.DataFrame({name: values for name, values in rows.items() if values is not None}).to_csv(file, index=False)


def asked(folder):
    return "predict", folder / "model", folder / "c.csv", "-o", folder / "p.csv"


def test_covariates_of_the_commands_reach_the_effects(run, folder, model):
    assert run(*asked(folder)).err == ""
    found = pd.read_csv(folder / "p.csv")
    q = pd.read_csv(folder / "c.csv")[["q1", "q2", "q3"]].to_numpy()
    covariates = {"session": ["1", "2", "3"], "payload": [0.0, 10.0, 20.0]}
    np.testing.assert_array_equal(found[["x", "y", "z"]], model.predict(q, covariates).T)


@pytest.mark.parametrize(
    ("column", "effect"), [("session", "zero_shift@cart1"), ("payload", "link_compliance@arm")], ids=lambda word: word
)
def test_a_missing_covariate_is_an_error_that_names_file_column_and_effect(folder, column, effect):
    write(folder / "c.csv", **{column: None})
    error = refused(folder, *asked(folder))
    assert f"c.csv, column {column}: " in error
    assert effect in error


def test_a_session_never_seen_is_predicted_with_one_warning(run, folder):
    write(folder / "c.csv", session=["1", "late", "2"])
    ran = run(*asked(folder), "--json")
    assert ran.code == 0
    (line,) = ran.err.splitlines()
    assert line.startswith("gtpin: warning: ")
    assert "late" in line
    assert [row["pose"] for row in json.loads(ran.out)] == ["a", "b", "c"]
    assert len(pd.read_csv(folder / "p.csv")) == 3


@pytest.mark.parametrize("payload", [[0.0, -1.0, 0.0], [0.0, "heavy", 0.0], [0.0, None, 0.0]], ids=str)
def test_a_covariate_that_can_t_be_is_refused_by_its_row(run, folder, payload):
    write(folder / "c.csv", payload=payload)
    assert "c.csv, row 3, column payload" in run(*asked(folder)).failed()


def test_a_hand_edited_effect_is_refused_by_file_and_key(folder):
    file = folder / "model" / "model.json"
    told = json.loads(file.read_text())
    told["effects"][1]["site"] = "cart1"
    file.write_text(json.dumps(told))
    assert f"{file}, column effects.1.site: " in refused(folder, *asked(folder))


def test_sensitivity_is_the_geometry_s_and_asks_for_no_covariates(run, folder, monkeypatch):
    def stop(*_, **__):
        raise gtpin.GtpinError("the commands were taken")

    monkeypatch.setattr("gtpin.commands.sensitivity.analyse", stop)
    write(folder / "c.csv", session=None, payload=None)
    ran = run("sensitivity", folder / "model", "--poses", folder / "c.csv", "-o", folder / "accuracy")
    assert "the commands were taken" in ran.failed()


@pytest.fixture(scope="module")
def wired(tmp_path_factory):
    """A model that four draw wires were read for."""
    folder = tmp_path_factory.mktemp("wired")
    robot = gtpin.load_robot("gantry_tau")
    made = simulate_measured(robot, "gantry_tau", ["range"], poses=20)
    made.write_dataset(folder / "set")
    gtpin.calibrate(Dataset.read(folder / "set")).save(folder / "out")
    return folder / "out"


def test_ids_of_stations_are_no_covariates_of_a_prediction(run, wired, tmp_path):
    commands = tmp_path / "commands.csv"
    commands.write_text("pose,q1,q2,q3,station\na,0.1,0.2,0.3,A\nb,0.1,0.2,0.3, B\n")
    ran = run("predict", wired, commands, "--instrument", "wire", "-o", tmp_path / "out.csv")
    assert (ran.code, ran.err) == (0, "")
    assert "2 readings of wire" in ran.out
    lines = (tmp_path / "out.csv").read_text().splitlines()
    assert [line.split(",")[:2] for line in lines] == [["pose", "station"], ["a", "A"], ["b", "B"]]


@pytest.mark.parametrize(
    ("header", "row", "told"),
    [("station", "Z", "row 3, column station: "), ("other", "1", "row 1, column station: "), ("station", "", "row 3")],
)
def test_a_station_that_can_t_be_is_named_by_its_line(run, wired, tmp_path, header, row, told):
    commands = tmp_path / "commands.csv"
    first = "A" if header == "station" else "2"
    commands.write_text(f"pose,q1,q2,q3,{header}\na,0.1,0.2,0.3,{first}\nb,0.1,0.2,0.3,{row}\n")
    ran = run("predict", wired, commands, "--instrument", "wire", "-o", tmp_path / "out.csv")
    assert f"commands.csv, {told}" in ran.failed()
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("measured", [True, False])
def test_orientations_that_positions_do_not_determine_are_told(run, measured, tmp_path):
    rng = np.random.default_rng(0)
    plain = closures.nominal("linear_delta")
    real = plain.off({key: size * rng.standard_normal() for key, size in plain.parameters().items()})
    q = plain.in_range(rng, 60, 0.7)
    T, R = real.follow(q, 0.02)
    turned = Rotation.from_matrix(R) * Rotation.from_rotvec(5e-5 * rng.standard_normal(T.shape))
    quaternions = turned.as_quat()[:, [3, 0, 1, 2]] if measured else None
    sigmas = {"position_sigma": 1e-5} | ({"orientation_sigma": 5e-5} if measured else {})
    seen = T + 1e-5 * rng.standard_normal(T.shape)
    data = Dataset("linear_delta", [f"p{k}" for k in range(60)], q, seen, quaternions, {}, sigmas)
    gtpin.write_model(gtpin.calibrate(data).model, tmp_path / "model")
    Commands([f"n{k}" for k in range(5)], q[:5], {}).write(tmp_path / "new.csv")
    ran = run("predict", tmp_path / "model", tmp_path / "new.csv", "-o", tmp_path / "out.csv")
    assert ran.code == 0
    assert ("orientations that the data do not determine" in ran.err) is not measured


@pytest.mark.parametrize("frame", ["robot", "free"])
def test_the_error_that_is_said_of_predicted_positions_is_that_of_new_poses(frame, run, tmp_path):
    rng, plain = np.random.default_rng(4), closures.nominal("linear_delta")
    real = plain.off({name: rng.normal(0.0, sigma) for name, sigma in plain.parameters().items()})
    turn, shift = (
        (Rotation.from_rotvec([0.1, 0.2, 1.0]), [2.0, 1.0, 0.3]) if frame == "free" else (Rotation.identity(), 0)
    )

    def seen(q):
        return turn.apply(real.follow(q, 0.02)[0]) + shift

    q, new = plain.in_range(rng, 100), plain.in_range(rng, 200)
    read = seen(q) + 2e-5 * rng.standard_normal((100, 3))
    known = {"position_sigma": 2e-5, "frame": frame}
    measured = Dataset("linear_delta", [f"p{n}" for n in range(100)], q, read, None, {}, known)
    gtpin.write_model(gtpin.calibrate(measured).model, tmp_path / "model")
    Commands([f"n{n}" for n in range(200)], new, {}).write(tmp_path / "c.csv")
    said = " ".join(run(*asked(tmp_path)).out.split())
    found = pd.read_csv(tmp_path / "p.csv")[["x", "y", "z"]].to_numpy()
    expected = float(re.search(r"expected error of ([\d.]+) \S+m RMS \(largest", said)[1])
    realised = 1e6 * np.sqrt(((found - seen(new)) ** 2).sum(axis=1).mean())
    assert 0.5 < expected / realised < 2.0


def test_the_error_that_is_said_is_that_of_a_declared_target(run, tmp_path):
    rng, robot, target = np.random.default_rng(3), gtpin.load_robot("ur5"), np.array([0.1, -0.15, 0.2])
    true = robot.model.copy()
    for joint in range(1, true.njoints):
        true.jointPlacements[joint] = true.jointPlacements[joint] * pin.exp6(rng.normal(0.0, 3e-4, 6))
    low, high = np.array([[-2.6, -2.2, -2.2, -2.5, -2.0, -2.8], [2.6, -0.4, 2.2, 2.5, 2.0, 2.8]])
    q, new = rng.uniform(low, high, (80, 6)), rng.uniform(low, high, (200, 6))

    def seen(q):
        T, R = placed(true, q, robot.tcp_frame)
        return T + R @ target

    read = seen(q) + 5e-5 * rng.standard_normal((80, 3))
    known = {"position_sigma": 5e-5, "target": tuple(target)}
    measured = Dataset("ur5", [f"p{n}" for n in range(80)], q, read, None, {}, known)
    gtpin.write_model(gtpin.calibrate(measured).model, tmp_path / "model")
    Commands([f"n{n}" for n in range(200)], new, {}).write(tmp_path / "c.csv")
    said = " ".join(run(*asked(tmp_path)).out.split())
    found = pd.read_csv(tmp_path / "p.csv")[["x", "y", "z"]].to_numpy()
    expected = 1e-6 * float(re.search(r"expected error of ([\d.]+) \S+m RMS \(largest", said)[1])
    assert 0.6 < expected / np.sqrt(((found - seen(new)) ** 2).sum(axis=1).mean()) < 1.6
