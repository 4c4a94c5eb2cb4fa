"""Numbers and names at their extremes are refused, or do no harm."""

from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin import errors
from gtpin.bench.simulator import simulate
from gtpin.data import Dataset
from gtpin.noise.reading_noise import line_of_sight
from gtpin.output.results import json_text


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    return simulate(gtpin.load_robot("gantry_tau"), "gantry_tau", poses=30, seed=3).dataset


@pytest.mark.parametrize("name", ["payload", "time", "temp_link", "fx", "speed1", "anything"])
def test_a_covariate_whose_powers_overflow_is_refused(dataset: Dataset, name: str) -> None:
    values = np.zeros(len(dataset))
    values[4] = 1e300
    with pytest.raises(errors.DatasetError, match="1e\\+30") as raised:
        replace(dataset, covariates={name: values})
    assert raised.value.column == name
    assert raised.value.row == int(dataset.row[4])


@pytest.mark.parametrize("length", [10_001, 1_000_000])
def test_an_id_that_nobody_can_read_is_refused_in_a_short_line(dataset: Dataset, length: int) -> None:
    pose = dataset.pose.copy()
    pose[2] = "a" * length
    with pytest.raises(errors.DatasetError, match=f"{length} letters") as raised:
        replace(dataset, pose=pose)
    assert len(str(raised.value)) < 200


def test_all_poses_at_the_same_commands_are_refused(dataset: Dataset) -> None:
    same = replace(
        dataset, pose=np.array(["a"] * len(dataset), dtype=object), q=np.tile(dataset.q[:1], (len(dataset), 1))
    )
    same = replace(same, position=np.tile(dataset.position[:1], (len(dataset), 1)), orientation=None)
    for run in (gtpin.calibrate, gtpin.diagnose):
        with pytest.raises(errors.DatasetError, match="the same commands"):
            run(same)


@pytest.mark.parametrize("size", [1.0, 1e6, 1e160, 1e300])
def test_a_gross_error_does_not_change_the_line_of_sight_of_other_poses(dataset: Dataset, size: float) -> None:
    station = np.array([1.5, -7.0, 0.3])
    spoilt = dataset.position.copy()
    spoilt[0] += [0.0, size, 0.0]
    sight, reach = line_of_sight(spoilt, station)
    assert np.isfinite(sight).all()
    assert np.isfinite(reach).all()
    alone, others = line_of_sight(dataset.position[1:], station)
    np.testing.assert_allclose(sight[1:], alone, rtol=1e-12)
    np.testing.assert_allclose(reach[1:], others, rtol=0.02)  # a pose within ten distances counts in their mean
    np.testing.assert_allclose(np.linalg.norm(sight, axis=1), 1.0, rtol=1e-12)


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("size", [0.5, 1e6, 1e160])
def test_a_gross_error_beside_a_station_is_set_aside(dataset: Dataset, size: float) -> None:
    instrument = dataset.instrument.model_copy(update={"station": (1.5, -7.0, 0.3)})
    position = dataset.position.copy()
    position[3, 1] += size
    found = gtpin.calibrate(replace(dataset, instrument=instrument, position=position))
    assert dataset.pose[3] in found.rejected
    assert len(found.rejected) <= 2


def test_rows_in_order_do_not_depend_on_the_order_that_they_came_in(dataset: Dataset) -> None:
    doubled = dataset.take([*range(len(dataset)), 0, 1, 2])
    expected = doubled.in_order()
    for seed in range(5):
        found = doubled.take(np.random.default_rng(seed).permutation(len(doubled))).in_order()
        np.testing.assert_array_equal(found.pose, expected.pose)
        np.testing.assert_array_equal(found.position, expected.position)


def test_a_number_that_is_not_finite_is_named_and_never_written() -> None:
    assert json_text({"a": [1.0, {"b": 0.1}]}) == '{\n "a": [\n  1.0,\n  {\n   "b": 0.1\n  }\n ]\n}\n'
    with pytest.raises(gtpin.GtpinError, match=r"for a\.1\.b"):
        json_text({"a": [1.0, {"b": float("nan")}]})


def test_a_message_of_thousands_of_letters_keeps_its_beginning_and_its_end() -> None:
    text = str(gtpin.GtpinError(f"no {'x' * 10_000} here", file="a.csv", hint="look elsewhere"))
    assert len(text) < 1100
    assert text.startswith("a.csv: no xxx")
    assert text.endswith("look elsewhere")
