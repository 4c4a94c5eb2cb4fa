"""Values that no sensor of a machine reads are set aside where they are few, and refused where they are many."""

from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.data import Conditions, Dataset, InstrumentSection
from gtpin.data.plausible import POSITION_STEPS, check_extremes, coarsest_step, counted_once, sane_rows, with_rounding
from gtpin.errors import DatasetError, GtpinError, GtpinWarning

N = 60


def day(seed=11, **columns):
    """Rows of an ordinary day: thermometers around 20 degC, speeds, payloads, forces and a clock."""
    rng = np.random.default_rng(seed)
    covariates = {
        "temp_frame": 20.0 + np.linspace(0.0, 3.0, N) + rng.normal(0, 0.05, N),
        "temp_link": 22.0 + rng.normal(0, 1.0, N),
        "temp_room": 15.0 + rng.normal(0, 2.0, N),
        "payload": rng.choice([0.0, 10.0, 20.0], N),
        "speed1": rng.choice([0.0, 1.0], N) * rng.normal(0, 0.3, N),
        "fz": rng.normal(0, 100.0, N),
        "time": np.cumsum(rng.uniform(10.0, 40.0, N)),
    }
    pose = [f"p{i}" for i in range(N)]
    q, position = rng.uniform(-1, 1, (N, 3)), rng.normal(0, 1, (N, 3))
    return Dataset("r", pose, q, position, covariates=covariates | columns, instrument=InstrumentSection())


def test_sections_of_dataset_toml_may_be_dicts():
    data = day()
    found = replace(data, instrument={"frame": "free", "target": "free"}, conditions={"reference_temperature": 22.0})
    assert found.instrument == InstrumentSection(frame="free", target="free")
    assert found.conditions == Conditions(reference_temperature=22.0)
    with pytest.raises(DatasetError, match=r"instrument\.frame.*write .robot. or .free."):
        replace(data, instrument={"frame": "base"})


def spoilt(column, value, rows):
    data = day()
    values = data.covariates[column].copy()
    values[rows] = value
    return replace(data, covariates={**data.covariates, column: values})


@pytest.mark.parametrize("seed", range(5))
def test_an_ordinary_day_passes_without_a_word(seed):
    assert sane_rows(day(seed)).all()


@pytest.mark.parametrize(
    ("column", "value"),
    [
        (t, v)
        for t in ("temp_frame", "temp_link", "temp_room")
        for v in (-999.0, 65535.0, 85.0, -273.15, -127.0, 0.0, 1e30)
    ]
    + [("payload", 1e12), ("payload", 65535.0), ("speed1", -999.0), ("fz", 32767.0), ("fz", 1e25), ("time", 1e30)],
)
def test_a_mark_of_no_reading_is_set_aside_with_its_pose(column, value):
    with pytest.warns(GtpinWarning, match=f"{column} of .* is no reading: poses p3, p40$") as caught:
        good = sane_rows(spoilt(column, value, [3, 40]))
    assert np.flatnonzero(~good).tolist() == [3, 40]
    assert len(caught) == 1


@pytest.mark.parametrize(
    ("column", "value"), [("temp_frame", -999.0), ("temp_link", 1e30), ("payload", 1e12), ("speed1", 1e6)]
)
def test_many_of_them_are_refused_with_the_first_row(column, value):
    with pytest.raises(DatasetError, match="20 of 60 rows") as caught:
        sane_rows(spoilt(column, value, slice(10, 30)))
    assert (caught.value.row, caught.value.column) == (12, column)


@pytest.mark.parametrize("value", [0.0, 85.0])
def test_a_temperature_that_others_are_near_is_a_reading(value):
    rng = np.random.default_rng(3)
    temperature = value + rng.uniform(-4.0, 4.0, N)
    temperature[5] = value
    around = Conditions(reference_temperature=value)
    assert sane_rows(replace(day(temp_frame=temperature), conditions=around)).all()


def test_a_column_of_times_may_count_from_anywhere_in_any_unit():
    clock = day().covariates["time"]
    for time in (clock - clock[0], 1.7e9 + clock, 1.7e12 + 1e3 * clock, 1.7e18 + 1e9 * clock, -clock):
        assert sane_rows(day(time=time)).all()


@pytest.mark.parametrize("celsius", [-10.0, 5.0, 20.0, 35.0, 80.0])
def test_kelvin_are_recognised(celsius):
    warm = celsius + np.linspace(0.0, 3.0, N)
    machine = replace(day(temp_frame=warm), conditions=Conditions(reference_temperature=celsius))
    assert sane_rows(machine).all()
    with pytest.raises(DatasetError, match=r"looks like kelvin; subtract 273\.15") as caught:
        sane_rows(day(temp_frame=warm + 273.15))
    assert caught.value.column == "temp_frame"


@pytest.mark.parametrize("celsius", [12.0, 20.0, 28.0, 36.0])
def test_fahrenheit_is_recognised_beside_a_reference_in_celsius(celsius):
    with pytest.raises(DatasetError, match="looks like degrees Fahrenheit"):
        sane_rows(day(temp_link=(celsius + np.linspace(0.0, 3.0, N)) * 1.8 + 32.0))


@pytest.mark.parametrize("celsius", [41.0, 55.0, 70.0, 95.0])
def test_a_hot_machine_is_believed_with_its_reference_temperature(celsius):
    hot = celsius + np.linspace(0.0, 3.0, N)
    assert sane_rows(replace(day(temp_link=hot), conditions=Conditions(reference_temperature=celsius))).all()


def test_speeds_in_millimetres_a_second_are_recognised():
    with pytest.raises(DatasetError, match="speed1 looks like mm/s"):
        sane_rows(day(speed1=day().covariates["speed1"] * 1000.0))


@pytest.mark.parametrize("times", [2, 10])
@pytest.mark.parametrize("renamed", [False, True])
def test_copies_of_rows_are_counted_once(times, renamed):
    data = day()
    copied = data.take(np.tile(np.arange(N), times))
    if renamed:
        copied = replace(copied, pose=np.arange(len(copied)).astype(str))
    with pytest.warns(GtpinWarning, match=f"{N * (times - 1)} of {N * times} rows repeat another"):
        once = counted_once(copied)
    assert np.array_equal(once.position, data.position)


def test_copies_with_other_times_or_temperatures_are_copies():
    data = day()
    joined = data.take(np.repeat(np.arange(N), 3))
    joined = replace(joined, covariates={**joined.covariates, "temp_frame": np.linspace(20.0, 23.0, 3 * N)})
    with pytest.warns(GtpinWarning, match="counted once"):
        assert len(counted_once(joined)) == N


@pytest.mark.parametrize(
    ("key", "changed"),
    [
        ("instrument.position_sigma", {"instrument": {"position_sigma": 1e-300}}),
        ("instrument.position_sigma", {"instrument": {"position_sigma": 1e300}}),
        ("instrument.position_sigma", {"instrument": {"position_sigma": 20}}),
        ("instrument.orientation_sigma", {"instrument": {"orientation_sigma": 1e300}}),
        ("instrument.station.1", {"instrument": {"station": (0.0, -1e6, 0.0)}}),
        ("conditions.reference_temperature", {"conditions": {"reference_temperature": 1e9}}),
        ("conditions.reference_temperature", {"conditions": {"reference_temperature": 293.15}}),
        ("tolerance.length", {"tolerance": {"length": 1e-300}}),
        ("tolerance.length", {"tolerance": {"length": 1e300}}),
    ],
)
def test_numbers_that_no_machine_has_are_refused_by_their_key(key, changed):
    with pytest.raises(DatasetError) as caught:
        replace(day(), **changed)
    assert caught.value.column == key
    assert caught.value.hint
    assert "\n" not in str(caught.value)


def test_ordinary_numbers_pass_and_a_reference_of_68_is_doubted():
    instrument = InstrumentSection(position_sigma=1.5e-5, orientation_sigma=5e-5, station=(1.5, -7.0, 0.3))
    check_extremes(replace(day(), instrument=instrument, tolerance={"length": 5e-4}))
    with pytest.warns(GtpinWarning, match="Fahrenheit"):
        check_extremes(replace(day(), conditions=Conditions(reference_temperature=68.0)))


def test_positions_beyond_any_unit_of_length_are_refused_with_their_column() -> None:
    data = day()
    with pytest.raises(GtpinError, match="half of the positions are"):
        check_extremes(replace(data, position=data.position * [1.0, 1.0, 1e299]))
    check_extremes(replace(data, position=1e9 * data.position))  # nanometres are named elsewhere


@pytest.fixture(scope="module")
def measured() -> gtpin.Dataset:
    return simulate(gtpin.load_robot("gantry_tau"), "gantry_tau", poses=80, seed=9).dataset


@pytest.mark.parametrize("step", [1e-2, 1e-3, 5e-4, 1e-4])
def test_the_noise_of_rounded_positions_is_what_rounding_makes_it(measured: gtpin.Dataset, step: float) -> None:
    rounded = replace(measured, position=np.round(measured.position / step) * step)
    assert coarsest_step(rounded.position, POSITION_STEPS) == step
    with pytest.warns(GtpinWarning, match="positions are rounded to"):
        found = with_rounding(rounded)
    declared = measured.instrument.position_sigma
    off = rounded.position - measured.position  # what rounding did, beside noise of the declared size
    assert declared is not None
    assert found.instrument.position_sigma == pytest.approx(np.hypot(declared, off.std()), rel=0.1)


def test_full_or_fine_digits_change_nothing(measured: gtpin.Dataset) -> None:
    assert coarsest_step(measured.position, POSITION_STEPS) is None
    assert with_rounding(measured) is measured
    fine = replace(measured, position=np.round(measured.position, 6))
    assert with_rounding(fine) is fine


def test_a_calibration_of_rounded_positions_fits_within_its_noise(measured: gtpin.Dataset) -> None:
    rounded = replace(measured, position=np.round(measured.position, 3))
    with pytest.warns(GtpinWarning, match="positions are rounded to 1 mm"):
        found = gtpin.calibrate(rounded)
    assert 0.7 < found.chi2_per_dof < 1.3
