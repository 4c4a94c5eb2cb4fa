"""Readings that can't be the robot's as they stand are refused in one line that names what is wrong; good ones are not."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from quick_first import quick_first
from readable import check_as_they_stand
from virtual_gantry import GANTRY, draw
from virtual_instruments import Seen, bed, cup, laser, level, read, wire

import gtpin
from gtpin.calibration.checks.instruments import check_sockets
from gtpin.errors import DatasetError, GtpinError, GtpinWarning

MACHINE = draw(np.random.default_rng(7))
RNG = np.random.default_rng(8)
WIRE, GAUGE = wire(MACHINE.gantry, RNG, 100), bed(MACHINE.gantry, RNG, 80, heights=True)
TOUCHES = bed(MACHINE.gantry, RNG, 60)
CUP, LEVEL, LASER = cup(MACHINE.gantry, RNG, 72), level(MACHINE.gantry, RNG, 80), laser(MACHINE.gantry, RNG, 60)
GOOD = {"wire": WIRE, "gauge": GAUGE, "touches": TOUCHES, "cup": CUP, "level": LEVEL, "laser": LASER}
UNITS = {"millimetres": 1e3, "centimetres": 1e2, "inches": 1.0 / 0.0254, "micrometres": 1e6}


def places(seen: Seen, key: str, factor: float) -> dict:
    """Points of dataset.toml in another unit."""
    found = {}
    for name, at in seen.said[key].items():
        if key == "planes":
            found[name] = at | {"point": [factor * v for v in at["point"]]}
        else:
            found[name] = [factor * v for v in at]
    return found


def scaled(seen: Seen, factor: float) -> list[float]:
    """Its target in another unit."""
    return [factor * v for v in seen.said["target"]]


def columns(seen: Seen, factor: float, *names: str) -> dict:
    return {name: np.array(seen.columns[name]) * factor for name in names}


def refused(folder: Path, *seen: Seen) -> GtpinError:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        dataset = read(folder / "set", *seen)
        with pytest.raises(GtpinError) as caught:
            gtpin.calibrate(dataset)
    assert "\n" not in str(caught.value)
    assert caught.value.hint
    return caught.value


def named(folder: Path, *seen: Seen) -> DatasetError:
    """What is said of readings that no fit explains as they stand, and any fit with the mistake corrected."""
    dataset = read(folder / "set", *seen)
    with pytest.raises(DatasetError) as caught:
        check_as_they_stand(dataset)
    assert caught.value.hint
    return caught.value


OTHER_UNITS: dict[str, tuple[Callable[[float], Seen], str, str]] = {
    "ranges": (lambda f: WIRE.reading(**columns(WIRE, f, "range")), "wire.csv", "range looks like"),
    "stations": (lambda f: WIRE.saying(stations=places(WIRE, "stations", f)), "dataset.toml", "stations look like"),
    "stations hardly known": (
        lambda f: WIRE.saying(stations=places(WIRE, "stations", f), station_sigma=0.5),
        "dataset.toml",
        "stations look like",
    ),
    "ranges and stations": (
        lambda f: WIRE.saying(stations=places(WIRE, "stations", f)).reading(**columns(WIRE, f, "range")),
        "wire.csv",
        "range and stations look like",
    ),
    "heights": (lambda f: GAUGE.reading(**columns(GAUGE, f, "height")), "bed.csv", "height looks like"),
    "planes": (lambda f: TOUCHES.saying(planes=places(TOUCHES, "planes", f)), "dataset.toml", "planes look like"),
    "a tip": (lambda f: TOUCHES.saying(target=scaled(TOUCHES, f)), "dataset.toml", "the target looks like"),
    "targets": (lambda f: CUP.saying(targets=places(CUP, "targets", f)), "dataset.toml", "the targets look like"),
    "positions": (lambda f: LASER.reading(**columns(LASER, f, "x", "y", "z")), "laser.csv", "x y z look like"),
    "sockets": (
        lambda f: CUP.saying(sockets={"S0": [f * CUP.truth[f"cup.point[S0].{x}"] for x in "xyz"]}, socket_sigma=1e-3),
        "dataset.toml",
        "sockets look like",
    ),
    "a distance": (
        lambda f: CUP.saying(distances=[[a, b, f * d, f * s] for a, b, d, s in CUP.said["distances"]]),
        "dataset.toml",
        "looks like",
    ),
}


FITTED = (
    ("ranges", "micrometres"),
    ("stations", "inches"),
    ("stations hardly known", "centimetres"),
    ("ranges and stations", "inches"),
    ("heights", "micrometres"),
    ("planes", "micrometres"),
    ("a tip", "millimetres"),
    ("targets", "millimetres"),
    ("positions", "micrometres"),
    ("sockets", "centimetres"),
    ("a distance", "inches"),
)
"""Mistakes that are refused by a whole calibration, which fits the readings as they stand for seconds: each kind, each unit."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "unit", "said"),
    [*((name, unit, named) for unit in UNITS for name in OTHER_UNITS), *((*pair, refused) for pair in FITTED)],
)
def test_another_unit_is_named_and_where(tmp_path, name, unit, said):
    make, file, looks = OTHER_UNITS[name]
    error = said(tmp_path, make(UNITS[unit]))
    assert isinstance(error, DatasetError)
    assert Path(str(error.file)).name == file
    assert f"{looks} {unit}" in str(error)
    assert error.column


@pytest.mark.slow
def test_a_target_in_millimetres_is_named_where_the_frame_could_take_most_of_it_in(tmp_path):
    error = refused(tmp_path, LASER.saying(target=scaled(LASER, 1e3)))
    assert "the target looks like millimetres" in error.what
    assert error.column == "instrument.0.target"


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "said"), [("millimetres", refused), ("inches", named)])
def test_another_unit_of_one_of_several_instruments_is_named(tmp_path, unit, said):
    wrong, file, looks = OTHER_UNITS["heights"]
    error = said(tmp_path, WIRE, LEVEL, wrong(UNITS[unit]), LASER)
    assert Path(str(error.file)).name == file
    assert f"bed: {looks} {unit}" in error.what


@pytest.mark.slow
@pytest.mark.parametrize(("side", "said"), [("heights", refused), ("normals", named)])
def test_a_plane_touched_from_below_is_named(tmp_path, side, said):
    if side == "heights":
        wrong = GAUGE.reading(**columns(GAUGE, -1.0, "height"))
    else:
        planes = {k: v | {"normal": [-x for x in v["normal"]]} for k, v in GAUGE.said["planes"].items()}
        wrong = GAUGE.saying(planes=planes)
    error = said(tmp_path, wrong)
    assert "other side of the plane" in error.what
    assert (Path(str(error.file)).name, error.column) == ("bed.csv", "height")


@pytest.mark.parametrize(("unit", "factor"), [("degrees", np.degrees(1.0)), ("mm/m", 1e3)])
def test_tilts_of_another_unit_are_named(tmp_path, unit, factor):
    error = refused(tmp_path, LEVEL.reading(**columns(LEVEL, factor, "tilt_x", "tilt_y")))
    assert unit in str(error)
    assert (Path(str(error.file)).name, error.column) == ("level.csv", "tilt_x tilt_y")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("looks", "x", "y", "signs", "said"),
    [
        ("have the other sign", "tilt_x", "tilt_y", (-1.0, -1.0), named),
        ("are swapped", "tilt_y", "tilt_x", (1.0, 1.0), named),
        ("quarter turn", "tilt_y", "tilt_x", (1.0, -1.0), refused),
    ],
)
def test_tilts_along_other_axes_are_named(tmp_path, looks, x, y, signs, said):
    wrong = LEVEL.reading(tilt_x=signs[0] * LEVEL.columns[x], tilt_y=signs[1] * LEVEL.columns[y])
    assert looks in said(tmp_path, wrong).what


def test_a_range_below_0_is_named_by_its_row(tmp_path):
    ranges = WIRE.columns["range"].copy()
    ranges[5] *= -1.0
    error = refused(tmp_path, WIRE.reading(range=ranges))
    assert (Path(str(error.file)).name, error.row, error.column) == ("wire.csv", 7, "range")


def with_id(seen: Seen, column: str, row: int, name: str) -> Seen:
    """Another id in one row."""
    return seen.reading(**{column: [name if i == row else at for i, at in enumerate(seen.columns[column])]})


def alone(seen: Seen, column: str) -> Seen:
    """Readings without their ids."""
    return Seen(seen.said, seen.q, {column: seen.columns[column]})


EACH_ONCE = CUP.saying(distances=None).reading(socket=[f"Z{i}" for i in range(72)])
NO_SUCH_PAIR = CUP.saying(distances=[["S1", "S9", 0.1, 1e-5]])
IDS: dict[str, tuple[Seen, int | None, str, str]] = {
    "a station that dataset.toml lacks": (with_id(WIRE, "station", 7, "E"), 9, "station", "A, B, C, D"),
    "a plane that it lacks": (with_id(GAUGE, "plane", 3, "E"), 5, "plane", "P, Q, R"),
    "a target that it lacks": (with_id(CUP, "target", 0, "E"), 2, "target", "A, B, C, D"),
    "targets that it does not list": (CUP.saying(targets=None), 8, "target", "targets = {A = ..., B = ...}"),
    "several stations and no column": (alone(WIRE, "range"), 1, "station", "A, B"),
    "several planes and no column": (alone(GAUGE, "height"), 1, "plane", "P, Q"),
    "a distance of a socket that no row has": (NO_SUCH_PAIR, None, "socket", "S0, S1"),
    "no socket visited twice": (EACH_ONCE, None, "socket", "several poses"),
}


@pytest.mark.parametrize("name", IDS)
def test_ids_that_do_not_fit_the_description_are_named(tmp_path, name):
    wrong, row, column, told = IDS[name]
    error = refused(tmp_path, wrong)
    assert Path(str(error.file)).suffix == ".csv"
    assert (error.row, error.column) == (row, column)
    assert told in error.hint


def test_a_socket_that_is_visited_once_is_warned_of_and_does_no_harm(tmp_path):
    once = with_id(CUP, "socket", 7, "Z")
    with pytest.warns(GtpinWarning, match="visited once, which gives no information: sockets Z"):
        found = gtpin.calibrate(read(tmp_path / "set", once))
    assert_calibrated(found)


def test_a_socket_that_is_visited_once_at_a_known_distance_from_another_says_something(tmp_path):
    other = next(at for at in CUP.columns["socket"] if at != CUP.columns["socket"][7])
    once = with_id(CUP, "socket", 7, "Z").saying(distances=[["Z", other, 0.5, 1e-4]])
    check_sockets(read(tmp_path / "set", once), gtpin.load_robot("gantry_tau"))  # a warning is an error


SIGMAS = {
    "millimetres": (WIRE.saying(sigma=0.02), "sigma of wire is 0.02", "times less"),
    "a tracker's in millimetres": (LASER.saying(position_sigma=0.015), "position_sigma of laser", "times less"),
    "a socket's in millimetres": (CUP.saying(sigma=0.02), "sigma of cup", "times less"),
}


@pytest.mark.parametrize("name", SIGMAS)
def test_a_sigma_that_is_far_from_what_the_data_show_is_named(tmp_path, name):
    wrong, told, ratio = SIGMAS[name]
    error = refused(tmp_path, wrong)
    assert Path(str(error.file)).name == "dataset.toml"
    assert told in error.what
    assert ratio in error.what


@pytest.mark.slow
@pytest.mark.study
def test_a_sigma_that_is_a_resolution_is_questioned_and_does_little_harm(tmp_path):
    with pytest.warns(GtpinWarning, match="or the declared sigma is too small"):
        found = gtpin.calibrate(read(tmp_path / "set", WIRE.saying(sigma=2e-7)))
    assert found.sigma_scale > 30.0  # sigmas of parameters are those of the noise that is there


def test_a_sigma_of_a_careful_data_sheet_is_not_used_and_warned_of(tmp_path):
    with pytest.warns(GtpinWarning, match="the noise of the data is used"):
        found = gtpin.calibrate(read(tmp_path / "set", WIRE.saying(sigma=8e-5)))
    assert_calibrated(found)


OTHER_MISTAKES = {
    "commands in millimetres": (Seen(WIRE.said, WIRE.q * 1e3, WIRE.columns), "q1", "millimetres"),
    "commands in another order": (Seen(WIRE.said, WIRE.q[:, [1, 0, 2]], WIRE.columns), None, "order of q1"),
    "commands of the next row": (Seen(WIRE.said, np.roll(WIRE.q, 1, axis=0), WIRE.columns), None, "commands"),
    "half the distance": (WIRE.reading(**columns(WIRE, 0.5, "range")), None, "commands"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHER_MISTAKES)
@pytest.mark.study
def test_other_mistakes_are_refused_with_what_to_check(tmp_path, name):
    wrong, column, told = OTHER_MISTAKES[name]
    error = refused(tmp_path, wrong)
    assert error.column == column
    assert told in error.hint or told in error.what


def test_two_rows_at_the_wrong_socket_are_set_aside(tmp_path):
    sockets = list(CUP.columns["socket"])
    sockets[6], sockets[13] = sockets[13], sockets[6]
    with pytest.warns(GtpinWarning, match="set aside as gross errors: poses (s6, s13|s13, s6)"):
        found = gtpin.calibrate(read(tmp_path / "set", CUP.reading(socket=sockets)))
    assert_calibrated(found)


@pytest.mark.parametrize("name", quick_first(GOOD, 3))
def test_good_readings_are_let_pass(tmp_path, name):
    assert_calibrated(gtpin.calibrate(read(tmp_path / "set", GOOD[name])))


@pytest.mark.slow
def test_good_readings_of_all_instruments_together_are_let_pass(tmp_path):
    several = (WIRE, TOUCHES, CUP, LEVEL, LASER)
    found = gtpin.calibrate(read(tmp_path / "set", *several))
    assert_calibrated(found)
    assert [one.name for one in found.by_instrument] == [one.said["name"] for one in several]


def test_small_tilts_of_a_platform_that_should_not_tilt_are_let_pass(tmp_path):
    # A linear delta's nominal platform stands level: tilts in any smaller unit would be nearer to that, and no more right.
    robot = gtpin.load_robot("linear_delta")
    rng = np.random.default_rng(10)
    nominal = gtpin.Geometry.nominal(robot)
    off = nominal.with_values(nominal.values + 3.0 * nominal.tolerance * rng.standard_normal(len(nominal.values)))
    lower, upper = np.array(robot.lower), np.array(robot.upper)
    q = (lower + upper) / 2.0 + 0.15 * (upper - lower) * rng.uniform(-1.0, 1.0, (60, 3))
    seen = gtpin.Model(off).predict(q).R[:, 2, :2] + rng.normal(0.0, 5e-5, (60, 2))
    said = {"name": "level", "kind": "tilt", "sigma": 5e-5}
    readings = read(tmp_path / "set", Seen(said, q, {"tilt_x": seen[:, 0], "tilt_y": seen[:, 1]}), robot="linear_delta")
    with pytest.warns(GtpinWarning, match="as a whole is farther from nominal"):  # three tolerances
        found = gtpin.calibrate(readings)
    assert np.median(np.abs(seen)) > 0.01  # where other readings are tried
    assert found.by_instrument[0].after < 2e-4


def test_stations_that_are_declared_twenty_centimetres_off_are_let_pass(tmp_path):
    rng = np.random.default_rng(9)
    off = {}
    for name, at in WIRE.said["stations"].items():
        way = rng.normal(size=3)
        off[name] = list(map(float, np.array(at) + 0.2 * way / np.linalg.norm(way)))
    assert_calibrated(gtpin.calibrate(read(tmp_path / "set", WIRE.saying(stations=off, station_sigma=0.5))))


def assert_calibrated(found):
    """Errors are as small as is told: none of 48 beyond five sigmas."""
    errors = found.model.geometry.deviation - np.array([MACHINE.deviations[name] for name in found.names])
    assert np.abs(errors / found.sigma).max() < 5.0


@pytest.mark.parametrize("value", quick_first([1e300, 1e6, -1e160, 1e30], 2))
@pytest.mark.parametrize(("name", "column"), [("gauge", "height"), ("laser", "x"), ("wire", "range")])
def test_a_number_that_nothing_reads_is_set_aside(tmp_path, name, column, value):
    values = np.array(GOOD[name].columns[column])
    values[3] = abs(value) if name == "wire" else value  # a range below 0 is refused
    dataset = read(tmp_path / "set", GOOD[name].reading(**{column: values}))
    with np.errstate(all="raise"), pytest.warns(GtpinWarning, match=r"set aside.*: pose [a-z]3$"):
        found = gtpin.calibrate(dataset)
    assert_calibrated(found)


@pytest.mark.parametrize("key", ["sockets", "stations", "planes", "targets"])
def test_what_no_row_uses_does_no_harm(tmp_path, key):
    seen = {"sockets": CUP, "stations": WIRE, "planes": GAUGE, "targets": CUP}[key]
    more = {"point": [0.0, 0.0, 1.0], "normal": [0.0, 0.0, 1.0]} if key == "planes" else [0.0, 0.0, 1.0]
    sigma = {"socket_sigma": 1e-3} if key == "sockets" else {}
    said = seen.saying(**{key: seen.said.get(key, {}) | {"Z": more}}, **sigma)
    assert_calibrated(gtpin.calibrate(read(tmp_path / "set", said)))


def test_a_single_row_of_an_instrument_says_nothing_against_its_sigma(tmp_path):
    once = Seen(LEVEL.said, LEVEL.q[:1], {name: column[:1] for name, column in LEVEL.columns.items()}, prefix="l")
    assert_calibrated(gtpin.calibrate(read(tmp_path / "set", WIRE, once)))


@pytest.mark.slow
def test_undeclared_sigmas_of_unequal_instruments_are_each_its_own_with_repeats(tmp_path):
    rng = np.random.default_rng(3)
    machine = GANTRY
    parts = {
        "wire": (wire(machine, rng, 90, sigma=1e-9), ["range"], 5e-4),
        "laser": (laser(machine, rng, 60, sigma=1e-9), ["x", "y", "z"], 1e-5),
    }
    read(tmp_path / "set", *(one.saying(sigma=None, position_sigma=None) for one, _, _ in parts.values()))
    for name, (_, columns, sigma) in parts.items():
        file = tmp_path / "set" / f"{name}.csv"
        table = pd.read_csv(file)
        visited = table.loc[table.index.repeat(3)]  # each pose, with its id, three times
        visited[columns] += sigma * rng.standard_normal((len(visited), len(columns)))
        visited.to_csv(file, index=False)
    found = gtpin.calibrate(gtpin.Dataset.read(tmp_path / "set"))
    for (name, (_, _, sigma)), seen in zip(parts.items(), found.noise.sigma, strict=True):
        assert seen == pytest.approx(sigma, rel=0.2), name


def test_one_bad_seating_in_a_socket_visited_twice_is_set_aside(tmp_path):
    rng = np.random.default_rng(8)
    machine = GANTRY
    good = cup(machine, rng, 74, sockets=37)
    q = good.q.copy()
    q[5, 0] += 2e-4
    bad = Seen(good.said, q, good.columns, good.truth)
    with pytest.warns(GtpinWarning, match="set aside"):
        found = gtpin.calibrate(read(tmp_path / "set", bad))
    assert "p5" in found.rejected
