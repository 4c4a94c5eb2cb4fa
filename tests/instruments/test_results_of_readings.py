"""Results of readings show themselves, are written and read again, and predict what they were fitted to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import build_measured
from gtpin.bench.simulator.case import drawn_recipe
from gtpin.data.files import read_table
from gtpin.errors import DatasetError, ModelError
from gtpin.instruments.predicted import predicted_readings

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Gantry-Tau with a backlash, measured by draw wires and a tilt sensor."""
    where = tmp_path_factory.mktemp("readings") / "measured"
    recipe = drawn_recipe(4, effects=[("backlash", "cart2")], noncentrality=1500.0, poses=120, background=False)
    build_measured(recipe, ["range", "tilt"]).write_dataset(where)
    return where


@pytest.fixture(scope="module")
def calibration(folder: Path) -> gtpin.Calibration:
    return gtpin.calibrate(gtpin.Dataset.read(folder))


@pytest.fixture(scope="module")
def diagnosis(folder: Path) -> gtpin.Diagnosis:
    return gtpin.diagnose(gtpin.Dataset.read(folder))


def test_a_model_with_instruments_is_read_as_it_was_written(calibration: gtpin.Calibration, tmp_path: Path) -> None:
    gtpin.write_model(calibration.model, tmp_path / "model")
    assert gtpin.read_model(tmp_path / "model").instruments == calibration.model.instruments


def test_predicted_readings_differ_from_the_measured_by_the_residuals(
    folder: Path, calibration: gtpin.Calibration
) -> None:
    table = read_table(folder / "wire.csv", ids=("station", "target"))
    q = table.matrix(["q1", "q2", "q3"])
    ids = {"station": table.columns["station"]}
    found = predicted_readings(calibration.model, calibration.model.predict(q), "wire", ids)["range"]
    wire = next(one for one in calibration.to_json()["by_instrument"].items() if one[0] == "wire")[1]
    off = np.sqrt(np.mean((table.columns["range"] - found) ** 2))
    assert off == pytest.approx(wire["rms_after"], rel=0.02)  # rows that were set aside are in one of the two alone


def test_an_instrument_that_a_model_lacks_is_named(calibration: gtpin.Calibration) -> None:
    poses = calibration.model.predict(calibration.model.robot.home_q[None])
    with pytest.raises(ModelError, match="wire"):
        predicted_readings(calibration.model, poses, "laser", {})


def test_json_lists_unknowns_errors_of_each_instrument_and_what_cant_be_seen(calibration: gtpin.Calibration) -> None:
    content = calibration.to_json()
    assert content["position_rms_after"] is None
    assert set(content["by_instrument"]) == {"wire", "level"}
    assert {one["unit"] for one in content["by_instrument"].values()} == {"m", "rad"}
    names = [one["name"] for one in content["parameters"]]
    assert "wire.station[A].x" in names
    assert "level.mount.rx" in names
    assert all(direction["words"].endswith(".") for direction in content["unobservable"])


@pytest.mark.slow
def test_a_diagnosis_of_readings_names_the_cause_and_the_gap_of_each_instrument(diagnosis: gtpin.Diagnosis) -> None:
    assert [(cause.effect, cause.site) for cause in diagnosis.causes] == [("backlash", "cart2")]
    gap = diagnosis.to_json()["gap"]
    assert gap["position_rms_before"] is None
    wire = gap["by_instrument"]["wire"]
    assert wire["rms_after"] < wire["rms_before"]
    assert 0.5 < gap["shrinkage"] <= 1.0


@pytest.mark.slow
def test_results_of_readings_show_themselves(
    calibration: gtpin.Calibration, diagnosis: gtpin.Diagnosis, tmp_path: Path
) -> None:
    assert "wire" in repr(calibration)
    assert "wire" in repr(diagnosis)
    assert "readings by wire, level" in repr(diagnosis.dataset)
    assert "instrument" in diagnosis.dataset.to_dataframe().columns
    calibration.save(tmp_path / "c")
    diagnosis.save(tmp_path / "d")
    page = (tmp_path / "d" / "report.html").read_text(encoding="utf-8")
    assert "wire.station[A].x" in page
    assert np.isfinite(calibration.unknown("wire.station[A].x").sigma)


def test_a_comparison_of_models_by_positions_refuses_readings(folder: Path) -> None:
    from gtpin.comparison.compare import compare

    with pytest.raises(DatasetError, match="readings"):
        compare(gtpin.Dataset.read(folder))
