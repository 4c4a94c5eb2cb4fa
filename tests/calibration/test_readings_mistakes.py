"""Mistakes in readings that a fit survives: each is counted as it should be, or told in words that name it."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from quick_first import quick_first
from scipy.spatial.transform import Rotation
from virtual_gantry import draw
from virtual_instruments import Seen, bed, camera, cup, laser, level, read, wire

import gtpin
from gtpin.calibration.checks.instruments import Misfit, check_fitted
from gtpin.calibration.problem import with_unknowns
from gtpin.data.plausible import counted_once
from gtpin.errors import DatasetError, GtpinError
from gtpin.instruments.readings import Readings, instruments_of, single
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
MACHINE = draw(np.random.default_rng(21))
RNG = np.random.default_rng(22)
WIRE, TOUCHES, CUP = wire(MACHINE.gantry, RNG, 100), bed(MACHINE.gantry, RNG, 60), cup(MACHINE.gantry, RNG, 72)
LEVEL, LASER, EYE = level(MACHINE.gantry, RNG, 80), laser(MACHINE.gantry, RNG, 60), camera(MACHINE.gantry, RNG, 80)


def rows(seen: Seen, of: Sequence[int]) -> Seen:
    """Some of the rows, in that order."""
    columns = {name: [values[i] for i in of] for name, values in seen.columns.items()}
    return Seen(seen.said, seen.q[list(of)], columns, seen.truth, seen.prefix)


def warned(folder, *seen: Seen) -> tuple[gtpin.Calibration, str]:
    """The calibration, and the words of all its warnings."""
    found = gtpin.calibrate(read(folder / "set", *seen))
    return found, "\n".join(found.warnings)


@pytest.mark.parametrize("seen", quick_first([WIRE, LASER, LEVEL, EYE], 2), ids=lambda seen: seen.said["name"])
def test_copies_of_readings_are_counted_once(tmp_path, seen):
    count = len(seen.q)
    copied = rows(seen, [*range(count), *range(0, count, 3)])
    found, said = warned(tmp_path, copied)
    once, _ = warned(tmp_path, seen)
    assert f"{seen.said['name']}.csv: {len(range(0, count, 3))} of {len(copied.q)} rows repeat another one's" in said
    assert f"(rows {count + 2}, {count + 3}, " in said
    np.testing.assert_allclose(found.sigma, once.sigma, rtol=1e-12)


def test_a_table_of_touches_that_is_there_twice_is_counted_once(tmp_path):
    found, said = warned(tmp_path, rows(TOUCHES, [*range(60), *range(60)]))
    assert "60 of 120 rows repeat" in said
    np.testing.assert_allclose(found.sigma, warned(tmp_path, TOUCHES)[0].sigma, rtol=1e-12)


def test_two_touches_at_the_same_commands_are_two(tmp_path):
    # Drives make whole steps, so that a point that is touched twice may have the same commands.
    dataset = read(tmp_path / "set", rows(TOUCHES, [*range(60), 4, 9]))
    assert len(counted_once(dataset)) == 62


def test_ranges_of_several_stations_at_one_stop_are_no_copies(tmp_path):
    dataset = read(tmp_path / "set", WIRE)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(counted_once(replace(dataset, q=np.tile(dataset.q[:1], (len(dataset), 1))))) == len(dataset)


@pytest.mark.slow
def test_quaternions_with_the_real_part_last_are_named(tmp_path):
    T, R = MACHINE.gantry.poses(LASER.q)
    columns = dict(zip(("x", "y", "z"), T.T, strict=True))
    columns |= dict(zip(("qw", "qx", "qy", "qz"), Rotation.from_matrix(R).as_quat().T, strict=True))
    said = {"name": "robot", "kind": "tracker", "position_sigma": 2e-5, "orientation_sigma": 5e-5}
    with pytest.raises(DatasetError, match=r"robot\.csv, column qw qx qy qz: robot: quaternions look like xyzw"):
        gtpin.calibrate(read(tmp_path / "set", Seen(said, LASER.q, columns), TOUCHES))


def test_sigmas_of_rows_in_millimetres_are_named(tmp_path):
    wrong = EYE.reading(**{name: 1e3 * np.array(EYE.columns[name]) for name in ("sx", "sy", "sz")})
    with pytest.raises(DatasetError, match=r"eye\.csv, column sx sy sz: sx sy sz of eye are .* times less"):
        gtpin.calibrate(read(tmp_path / "set", wrong))


def test_sigmas_of_rows_that_are_far_too_large_are_not_used(tmp_path):
    wrong = EYE.reading(**{name: 5.0 * np.array(EYE.columns[name]) for name in ("sx", "sy", "sz")})
    found, said = warned(tmp_path, wrong)
    assert "sx sy sz of eye are" in said
    assert "the noise of the data is used" in said
    assert found.noise.estimated.all()


def test_noise_that_all_rows_declare_is_not_estimated(tmp_path):
    found, said = warned(tmp_path, EYE)
    assert not said
    assert not found.noise.estimated.any()
    assert "by construction" not in found.summary()


def test_a_station_whose_readings_are_in_another_unit_is_named(tmp_path):
    of = np.array(WIRE.columns["station"])
    ranges = np.where(of == "B", 1e3, 1.0) * WIRE.columns["range"]
    _, said = warned(tmp_path, WIRE.reading(range=ranges))
    count = int((of == "B").sum())
    assert f"{count} of {count} readings of wire with station B do not fit the others" in said
    assert "station A" not in said
    assert f"and {count - 10} more" in said  # poses, of which not all are named


def test_a_station_at_another_place_is_named(tmp_path):
    stations = {name: list(at) for name, at in WIRE.said["stations"].items()}
    stations["B"][0] += 2.0
    _, said = warned(tmp_path, WIRE.saying(stations=stations))
    assert "wire does not look to be where dataset.toml has it: wire.station[B].x -2" in said


def test_planes_with_each_other_s_names_are_named(tmp_path):
    swapped = [{"P": "Q", "Q": "P"}.get(name, name) for name in TOUCHES.columns["plane"]]
    try:
        _, said = warned(tmp_path, TOUCHES.reading(plane=swapped))
    except GtpinError as error:
        said = str(error)
    assert "bed.plane[P].height" in said or "readings of bed" in said


@pytest.mark.parametrize("off", quick_first([0.03, 0.1]))
def test_a_bed_that_is_declared_elsewhere_is_told_and_the_geometry_is_as_with_the_right_place(tmp_path, off):
    planes = {name: p | {"point": [*p["point"][:2], p["point"][2] + off]} for name, p in TOUCHES.said["planes"].items()}
    right, nothing = warned(tmp_path, TOUCHES)
    found, said = warned(tmp_path, TOUCHES.saying(planes=planes))
    assert "bed does not look to be where dataset.toml has it" in said
    assert "does not look to be" not in nothing
    assert "not this machine" not in said
    shift = np.array([value for u, value in zip(found.unknowns, found.u, strict=True) if u.name.endswith("height")])
    np.testing.assert_allclose(
        shift, -off, rtol=0, atol=0.012
    )  # a bed 100 mm off, as its tilts of 1 mrad and heights know it
    assert (np.abs(found.values - right.values) < 3.0 * np.hypot(found.sigma, right.sigma)).all()


def test_a_drive_whose_zero_is_off_is_not_told_as_a_bed_elsewhere(tmp_path):
    shifted = TOUCHES.q + np.array([0.0, 0.0, 0.02])
    _, said = warned(tmp_path, replace(TOUCHES, q=shifted))
    assert "the geometry as a whole is farther from nominal" in said
    assert "does not look to be" not in said


def test_a_known_distance_that_is_a_centimetre_off_is_warned_of(tmp_path):
    distances = [[a, b, d + 0.01, s] for a, b, d, s in CUP.said["distances"]]
    _, said = warned(tmp_path, CUP.saying(distances=distances))
    assert "readings of cup with socket" in said or "tolerances" in said


@pytest.mark.parametrize(
    "others", quick_first([[TOUCHES], [WIRE, LEVEL], [EYE, CUP]]), ids=["touches", "wire, level", "camera, cup"]
)
def test_gross_errors_of_one_instrument_alone_are_set_aside(tmp_path, others):
    bad = np.array([5, 17, 40])
    x = np.array(LASER.columns["x"])
    x[bad] += 5e-3
    found, text = warned(tmp_path, LASER.reading(x=x), *others)
    assert found.rejected == tuple(f"m{i}" for i in bad)
    assert "gross errors" in text


@pytest.mark.parametrize("left", range(5))
def test_readings_of_which_an_instrument_has_no_row_keep_its_numbers_and_unknowns(tmp_path, left):
    rng = np.random.default_rng(left)
    turns = Rotation.random(len(LASER.q), rng=rng).as_quat(scalar_first=True)
    posed = LASER.reading(**dict(zip(("qw", "qx", "qy", "qz"), turns.T, strict=True))).saying(name="posed")
    robot = gtpin.load_robot("gantry_tau")
    data = single(read(tmp_path / "set", LASER, posed, EYE, CUP, TOUCHES), robot)
    whole = Readings.of(data, robot)
    poses = Poses(rng.standard_normal((len(whole.q), 3)), exp(rng.standard_normal((len(whole.q), 3))))
    u = 1e-3 * rng.standard_normal(len(whole.u))
    some = np.flatnonzero(whole.rows.of != left)
    part, whole, there = whole.take(some).at(u), whole.at(u), poses[some]
    assert part.unknowns == whole.unknowns
    assert part.declared == whole.declared
    assert [one.table for one in part.fitted] == [one.table for one in whole.fitted]
    assert [one.columns for one in part.fitted] == [one.columns for one in whole.fitted]
    np.testing.assert_array_equal(part.group, whole.group[some])
    np.testing.assert_array_equal(part.row_sigma, whole.row_sigma[some])
    np.testing.assert_array_equal(part.counted, whole.counted[some])
    assert part.start(there).shape == u.shape
    assert part.rms(left, part.residual_at(there)) == 0.0
    for of in ("residual_at", "by_motion", "by_unknown"):
        np.testing.assert_allclose(getattr(part, of)(there), getattr(whole, of)(poses)[some], atol=1e-12)


def test_known_distances_stay_with_their_rows_in_any_part_of_the_rows(tmp_path):
    rng = np.random.default_rng(0)
    pairs, robot = cup(draw(rng).gantry, rng, 12, sockets=4), gtpin.load_robot("gantry_tau")
    whole = single(read(tmp_path / "set", pairs), robot)  # every socket has one known distance, and so has every row
    (one,) = instruments_of(whole.readings, robot)
    assert set(one.link) == {0, 1}
    for row in range(len(whole)):
        (part,) = instruments_of(whole.take([row]).readings, robot)
        assert part.table.distances[part.link[0]] == one.table.distances[one.link[row]]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_a_machine_within_its_tolerances_is_not_warned_of(tmp_path, seed):
    rng = np.random.default_rng(100 + seed)
    machine = draw(rng).gantry
    for make, count in ((wire, 100), (bed, 60), (cup, 72), (camera, 80)):
        assert not warned(tmp_path, make(machine, rng, count))[1]


def test_one_reading_is_not_said_to_contradict_its_sigma(tmp_path):
    try:
        found, said = warned(tmp_path, rows(WIRE, [0]))
        assert found.observability.variance_reduction.max() < 0.5
        assert "there are too few measurements" in found.summary()
    except GtpinError as error:
        said = str(error)
    assert "noise" not in said


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 5, 10, 15])
def test_fewer_readings_than_unknowns_are_fitted_or_refused_for_that(tmp_path, count):
    few = wire(MACHINE.gantry, np.random.default_rng(count), count, away=0.5, offset=1e-3)
    refused = None
    try:
        warned(tmp_path, few)
    except GtpinError as error:
        refused = error
    assert refused is None or any(f"{count} {words}" in refused.what for words in ("readings", "measured numbers"))


def test_an_impossible_covariate_is_named_by_its_table_and_line(tmp_path):
    slow = LEVEL.reading(payload=np.full(80, 1.0))
    warm = np.full(100, 20.0) + np.linspace(0.0, 3.0, 100)
    warm[40:] = 1e6
    hot = WIRE.reading(temp_frame=warm)
    dataset = read(tmp_path / "set", slow.reading(temp_frame=np.full(80, 20.0)), hot.reading(payload=np.ones(100)))
    with pytest.raises(DatasetError, match="temperature") as caught:
        gtpin.calibrate(dataset)
    assert caught.value.file is not None
    assert (caught.value.file.name, caught.value.row) == ("wire.csv", 42)


def test_a_command_far_outside_is_named_by_its_table_and_line(tmp_path):
    q = TOUCHES.q.copy()
    q[7, 1] = 55.0
    with pytest.raises(DatasetError, match="far outside") as caught:
        gtpin.calibrate(read(tmp_path / "set", LEVEL, Seen(TOUCHES.said, q, TOUCHES.columns, {}, "t")))
    assert caught.value.file is not None
    assert (caught.value.file.name, caught.value.row, caught.value.column) == ("bed.csv", 9, "q2")


@pytest.mark.parametrize(("key", "value"), [("sigma", 20.0), ("sigma", 1e-12)], ids=["micrometres", "nothing"])
def test_a_sigma_that_no_instrument_has_is_refused(tmp_path, key, value):
    with pytest.raises(DatasetError, match=rf"instrument\.0\.{key}: .* can't be"):
        gtpin.calibrate(read(tmp_path / "set", WIRE.saying(**{key: value})))


GAUGE = bed(MACHINE.gantry, np.random.default_rng(23), 80, heights=True, near=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("declared", [True, False])
@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (-1.0, "heights are of the other side of the plane"),
        (1e3, "height looks like millimetres"),
        (1e-3, "heights look a thousand times too small"),
    ],
)
@pytest.mark.study
def test_sign_and_unit_of_heights_that_are_smaller_than_the_robot_s_errors_are_named(tmp_path, factor, words, declared):
    gauge = GAUGE if declared else GAUGE.saying(sigma=None)
    assert warned(tmp_path, gauge)[0].by_instrument[0].after < 2e-5
    with pytest.raises(DatasetError, match=rf"bed\.csv, column height: bed: {words}"):
        gtpin.calibrate(read(tmp_path / "set", gauge.reading(height=factor * GAUGE.columns["height"])))


def test_readings_that_a_fit_makes_far_worse_are_refused(tmp_path):
    dataset = read(tmp_path / "set", GAUGE)
    nominal = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
    near = nominal.kinematics.forward(dataset.q)
    readings = with_unknowns(Readings.of(dataset, nominal.robot), near)
    before = [Misfit.of(readings, near, 0)]
    check_fitted(dataset, readings, near, 1.0, before)
    with pytest.raises(DatasetError, match=r"off what the calibrated robot gives, and .* off what the nominal"):
        check_fitted(dataset, readings, replace(near, T=near.T + np.array([0.0, 0.0, 0.1])), 1.0, before)
