"""What a calibration tells: its JSON, its text, and the model that it leaves behind."""

import json
import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import virtual_gantry
from quick_first import quick_first
from scipy.spatial.transform import Rotation
from virtual_gantry import commands, names, undeclared

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.data import InstrumentSection
from gtpin.diagnosis.priors import PRIORS
from gtpin.errors import GtpinError
from gtpin.report.calibration_text import scatters

RMS = [f"{what}_rms_{when}" for what in ("position", "orientation") for when in ("before", "after")]
KEYS = {"schema": str, "model": str, "poses": int, "rejected": list, "chi2_per_dof": float, "iterations": int}
KEYS |= dict.fromkeys(RMS, float) | dict.fromkeys(("parameters", "unobservable", "correlations"), list)
PARAMETER = {"name": str, "unit": str} | dict.fromkeys(("value", "sigma", "nominal", "tolerance", "learned"), float)


def calibrated(seed=0, drawn=None, free=False, **options):
    _, dataset = virtual_gantry.case(np.random.default_rng(seed), 60, drawn, free=free)
    return dataset, gtpin.calibrate(dataset, **options)


@pytest.fixture(scope="module")
def case():
    return calibrated()


def test_the_json_has_the_contract_s_keys_and_types(case):
    _, found = case
    told = json.loads(json.dumps(found.to_json(), allow_nan=False))
    for key, kind in KEYS.items():
        assert isinstance(told[key], kind), key
    assert told["schema"] == "gtpin-calibration/1"
    assert told["poses"] == 60
    assert told["rejected"] == []
    for entry in told["parameters"]:
        assert {key: type(value) for key, value in entry.items()} == PARAMETER
        assert 0.0 < entry["sigma"] <= entry["tolerance"] * (1 + 1e-9)
        assert entry["learned"] == pytest.approx(1.0 - (entry["sigma"] / entry["tolerance"]) ** 2)
        assert entry["unit"] == ("rad" if entry["name"].startswith("track") else "m")
    assert sorted(entry["name"] for entry in told["parameters"]) == sorted(names())
    assert told["unobservable"]
    for entry in told["unobservable"]:
        assert set(entry) == {"direction", "learned", "words"}
        assert set(entry["direction"]) <= set(names())
    assert told["correlations"]
    for entry in told["correlations"]:
        assert set(entry) == {"a", "b", "rho"}
        assert entry["a"] != entry["b"]
        assert abs(entry["rho"]) <= 1.0


def test_root_mean_squares_are_of_the_error_s_length_per_pose(case):
    dataset, found = case
    told = found.to_json()
    for model, word in ((found.model, "after"), (gtpin.Model(gtpin.Geometry.nominal(found.model.robot)), "before")):
        poses = model.predict(dataset.q)
        position = np.sqrt(((dataset.position - poses.T) ** 2).sum(axis=1).mean())
        turn = Rotation.from_quat(dataset.orientation, scalar_first=True) * Rotation.from_matrix(poses.R).inv()
        assert told[f"position_rms_{word}"] == pytest.approx(position)
        assert told[f"orientation_rms_{word}"] == pytest.approx(np.sqrt((turn.magnitude() ** 2).mean()))
    assert told["position_rms_after"] < 1e-4 < told["position_rms_before"]


def test_where_no_orientation_was_measured_none_is_told(case):
    dataset, _ = case
    found = gtpin.calibrate(replace(dataset, orientation=None))
    told = found.to_json()
    assert told["orientation_rms_before"] is None
    assert told["orientation_rms_after"] is None
    assert "orientation error" not in found.summary()


def test_the_text_names_every_parameter_and_the_fit(case):
    _, found = case
    text = found.summary()
    assert all(name in text for name in names())
    assert f"{found.chi2_per_dof:.2f}" in text
    assert "as declared" in text
    assert "No pose was set aside" in text


def test_the_text_names_poses_that_were_set_aside(case):
    dataset, _ = case
    position = dataset.position.copy()
    position[[4, 31], 2] += 0.02
    with pytest.warns(gtpin.GtpinWarning, match="4, 31"):
        found = gtpin.calibrate(replace(dataset, position=position))
    assert set(found.to_json()["rejected"]) >= {"4", "31"}
    table = found.summary().partition("Set aside")[2]
    assert {"4", "31"} <= {line.split()[0] for line in table.splitlines() if line.strip()}


@pytest.mark.slow
def test_the_text_admits_a_lack_of_fit_and_says_where_sigmas_come_from(case):
    dataset, _ = case
    fine = InstrumentSection(position_sigma=5e-6, orientation_sigma=2e-5)
    found = gtpin.calibrate(replace(dataset, instrument=fine))
    assert "does not explain" in found.summary()
    assert found.to_json()["chi2_per_dof"] > 4.0
    assert "from the residuals" in gtpin.calibrate(undeclared(dataset)).summary()


@pytest.mark.parametrize(
    ("free", "options"),
    quick_first(
        [(True, {"directions": "rod", "scale": "rod"}), (False, {"without": ["length"]}), (False, {}), (True, {})], 2
    ),
    ids=str,
)
def test_a_model_folder_gives_the_same_model_again(tmp_path, free, options):
    drawn = [name for name in names() if not name.startswith(tuple(options.get("without", ["-"])))]
    _, found = calibrated(1, drawn, free=free, **options)
    gtpin.write_model(found.model, tmp_path / "model")
    q = commands(np.random.default_rng(5), 40)
    expected = found.model.predict(q)
    for reference in (tmp_path / "model", tmp_path, tmp_path / "model" / "model.json"):
        again = gtpin.read_model(reference)
        assert again.geometry.names == found.names
        assert np.array_equal(again.geometry.values, found.values)
        assert np.array_equal(again.geometry.tolerance, found.model.geometry.tolerance)
        assert np.array_equal(again.predict(q).T, expected.T)
        assert np.array_equal(again.predict(q).R, expected.R)


@pytest.mark.parametrize("seed", quick_first(range(3)))
def test_the_urdf_of_a_calibrated_model_predicts_what_the_model_does(tmp_path, seed):
    _, found = calibrated(seed)
    gtpin.write_model(found.model, tmp_path)
    q = commands(np.random.default_rng(seed), 40)
    expected = found.model.predict(q)
    assert np.abs(gtpin.read_model(tmp_path / "robot.urdf").predict(q).minus(expected)).max() < 1e-9
    # And by Pinocchio alone: the loops close at the model's poses, found from the URDF's own numbers.
    robot = gtpin.load_robot(tmp_path / "robot.urdf")
    posture = gtpin.home(robot)
    for i in range(0, 40, 8):
        there = posture.moved_to(q[i])
        assert np.abs(there.T - expected.T[i]).max() < 1e-9
        assert np.abs(pin.log3(there.R @ expected.R[i].T)).max() < 1e-9


@pytest.mark.parametrize(
    "content", ["[" * 100_000, '{"schema": 1' + "0" * 10_000 + "}", "", "null", "[]", '"model"'], ids=lambda t: t[:8]
)
def test_a_model_json_that_is_no_model_is_refused(tmp_path, content):
    (tmp_path / "model.json").write_text(content)
    with pytest.raises(GtpinError, match=r"model\.json"):
        gtpin.read_model(tmp_path)


def test_a_model_without_its_urdf_is_refused(tmp_path, case):
    gtpin.write_model(case[1].model, tmp_path)
    (tmp_path / "nominal.urdf").unlink()
    with pytest.raises(GtpinError, match=r"nominal\.urdf"):
        gtpin.read_model(tmp_path)


def test_a_fit_that_is_worse_than_the_nominal_robot_is_told_on_the_first_line():
    _, found = calibrated()
    assert not found.worse
    position, orientation = found.by_instrument
    grown = replace(orientation, before=orientation.after, after=2.0 * orientation.after)
    worse = replace(found, by_instrument=(position, grown))
    text = worse.summary()
    assert text.splitlines()[0].endswith(": worse than nominal")
    assert re.search(r"The fit makes the orientation error from \d+ to \d+ urad: don't use this model\.", text)


@pytest.mark.parametrize("name", quick_first(["so100", "gantry_tau", "ur5"]))
def test_the_scatter_of_drives_is_compared_with_noise_where_it_is_measured(name: str) -> None:
    """Whether drives turn or slide, and however long the arm is: commands scattered by 10 um or 10 urad, predicted."""
    rng, robot = np.random.default_rng(0), gtpin.load_robot(name)
    found = gtpin.calibrate(simulate(robot, name, poses=60, seed=1, held_out=1).dataset)
    repeatability, q = 1e-5, np.repeat(found.dataset.q, 50, axis=0)
    there = found.model.predict(q + rng.normal(0.0, repeatability, q.shape)).T
    sizes = (there - found.model.predict(q).T).reshape(-1, 50, 3).std(axis=1)
    sigma = found.noise.position_sigma
    scattering = replace(found, noise=replace(found.noise, repeatability=repeatability))
    assert scattering.drive_scatter == pytest.approx(np.median(sizes) / sigma, rel=0.1)
    for share, told in ((0.8, False), (1.25, True)):
        size = share * PRIORS.scatters * sigma / float(np.median(sizes)) * repeatability
        assert bool(scatters(replace(found, noise=replace(found.noise, repeatability=size)))) is told
