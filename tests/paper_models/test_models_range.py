"""A measured track holds where it was measured, and a model on one keeps it on disk."""

from dataclasses import replace
from pathlib import Path

import model_machines as mm
import numpy as np
import pytest

import gtpin
from gtpin import Commands, Dataset, Model
from gtpin.errors import DatasetError, GtpinWarning, ModelError
from gtpin.model.predict import predict
from gtpin.paper.models import model_geometry

PATHS = tuple(mm.bent(mm.AXES[c], mm.wavy(1e-4, 50 + c)) for c in range(3))
TURNS = tuple(mm.bent(np.zeros(3), mm.wavy(2e-4, 60 + c)) for c in range(3))
Q = mm.commands(40, seed=1)


def dataset(q: np.ndarray) -> Dataset:
    short = mm.carts_of(PATHS, turns=TURNS)
    rows = np.abs(short.q) < 0.56  # measured from -0.55 to 0.55 m
    carts = gtpin.data.CartMeasurements(short.cart[rows], short.q[rows], short.position[rows], short.orientation[rows])
    return mm.Machine.nominal().dataset(q, 1e-5, 5e-5, 0, carts)


def model(number: int, *, orientations: bool = False) -> Model:
    nominal = model_geometry(number, mm.ROBOT, dataset(Q), orientations=orientations)
    rng = np.random.default_rng(number)
    return Model(
        nominal.with_values(nominal.values + 0.5 * nominal.tolerance * rng.standard_normal(len(nominal.values)))
    )


@pytest.mark.parametrize("number", [2, 4])
@pytest.mark.parametrize("cart", [0, 1, 2])
def test_a_prediction_outside_any_measured_track_is_none(number: int, cart: int):
    q = np.array([[0.1, 0.1, 0.1], [0.55, 0.55, 0.55], [0.1, 0.1, 0.1]])
    q[2, cart] = -0.551
    assert model(number).predict(q).reached.tolist() == [True, True, False]
    with pytest.raises(ModelError, match="pose far leaves the range"):
        predict(model(number), Commands(np.array(["a", "b", "far"], dtype=object), q))


def test_only_rods_on_measured_tracks_bound_the_range():
    q = np.array([[0.65, 0.2, 0.2], [0.2, 0.2, 0.65], [0.3, 0.6, 0.3]])
    assert model(5).predict(q).reached.tolist() == [True, True, False]
    assert model(3).predict(q).reached.all()


@pytest.mark.slow
def test_calibration_sets_poses_outside_the_tracks_aside_by_name():
    q = mm.commands(80, seed=2)
    q[[5, 7]] = [[0.6, 0.0, 0.0], [0.0, -0.6, 0.0]]
    q[[i for i in range(80) if i not in (5, 7)]] *= 0.9
    with pytest.warns(GtpinWarning, match="outside the measured tracks: poses 5, 7"):
        assert {"5", "7"} <= set(gtpin.calibrate(dataset(q), model=4).rejected)


def test_models_that_need_cart_measurements_say_so():
    without = mm.Machine.nominal().dataset(Q, 1e-5, 5e-5, 0)
    for number in (2, 4, 5):
        with pytest.raises(DatasetError, match=r"carts\.csv"):
            model_geometry(number, mm.ROBOT, without)


@pytest.mark.parametrize(
    ("number", "orientations"), [(1, False), (2, False), (2, True), (3, False), (4, True), (5, False)]
)
def test_a_model_on_disk_is_the_same_model(number: int, orientations: bool, tmp_path: Path):
    before = model(number, orientations=orientations)
    gtpin.write_model(before, tmp_path)
    after = gtpin.read_model(tmp_path)
    assert after.geometry.names == before.geometry.names
    assert after.geometry.positions_only == before.geometry.positions_only == (number < 3)
    q = 0.9 * Q
    difference = after.predict(q).minus(before.predict(q))
    assert np.abs(difference).max() < 1e-12
    assert (after.geometry.outside(2.0 * Q) == before.geometry.outside(2.0 * Q)).all()


def test_the_turning_of_carts_is_refused_where_no_track_is_measured():
    with pytest.raises(ModelError, match="no measured tracks"):
        gtpin.calibrate(dataset(Q), model=3, orientations=True)


@pytest.mark.slow
def test_models_weigh_by_what_they_leave_whatever_was_declared():
    data = dataset(0.9 * Q)
    rough = replace(data, instrument=data.instrument.model_copy(update={"position_sigma": 1e-3}))
    one, other = (gtpin.calibrate(each, model=4) for each in (data, rough))
    np.testing.assert_array_equal(one.values, other.values)
