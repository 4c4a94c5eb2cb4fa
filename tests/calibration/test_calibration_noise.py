"""What the noise is taken to be: declared, from repeats or from residuals, of trackers, with heavy tails and gross errors."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from monte_carlo import ONCE, assert_chi2, study
from quick_first import quick_first
from scipy.stats import binom, chi2, multivariate_normal
from scipy.stats import t as student
from virtual_gantry import (
    GANTRY,
    ORIENTATION_SIGMA,
    POSITION_SIGMA,
    case,
    commands,
    draw,
    measured,
    tolerance,
    undeclared,
)

import gtpin
from gtpin.data import InstrumentSection
from gtpin.noise.estimate import from_repeats, tamed
from gtpin.noise.reading_noise import ReadingNoise

MACHINES = 20
SIGMAS = np.repeat([POSITION_SIGMA, ORIENTATION_SIGMA], 3)


def mean_is(values, truth, bias=0.0):
    """The mean of independent estimates is the truth within what their own scatter allows, and a bias that is stated."""
    bound = student.isf(ONCE / 2, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values)) + bias
    assert abs(np.mean(values) - truth) < bound, (np.mean(values), truth, bound)


def sigmas_are_told(found, bias):
    """The mean estimates are the sigmas of the tracker, but for a share."""
    for unit, sigma in enumerate((POSITION_SIGMA, ORIENTATION_SIGMA)[: found.calibrations[0].residual.shape[1] // 3]):
        mean_is([c.noise.sigma[unit] for c in found.calibrations], sigma, bias * sigma)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["poses", "positions", "repeats"])
def test_undeclared_noise_is_estimated_without_bias(kind):
    def make(rng):
        machine, q = draw(rng), commands(rng, 80)
        visits = np.concatenate([np.arange(80), np.arange(20 if kind == "repeats" else 0)])
        return machine, undeclared(measured(machine, q[visits], rng, pose=visits, orientation=kind != "positions"))

    found = study(make, MACHINES)
    # Of 1 %: the estimate of a sigma from its square is low by a quarter over the freedoms, here 0.1 %.
    sigmas_are_told(found, 0.01)
    found.assert_covers()
    found.assert_unbiased()


@pytest.mark.slow
@pytest.mark.parametrize("declared", [True, False], ids=["declared", "undeclared"])
def test_repeated_visits_show_the_repeatability_of_the_carts(declared):
    truth = 20e-6

    def make(rng):
        machine = draw(rng)
        visits = np.repeat(np.arange(60), 3)
        asked = commands(rng, 60)[visits]
        # The carts come to rest elsewhere each time; the commands are the same.
        true = measured(machine, asked + truth * rng.standard_normal(asked.shape), rng)
        dataset = replace(true, q=asked, pose=visits)
        return machine, dataset if declared else undeclared(dataset)

    found = study(make, 16)
    mean_is([c.noise.repeatability for c in found.calibrations], truth, 0.01 * truth)
    # Undeclared, what belongs to the tracker is told from what belongs to the carts.
    sigmas_are_told(found, 0.02)
    found.assert_covers()
    found.assert_unbiased()
    if declared:
        mean_is([c.chi2_per_dof for c in found.calibrations], 1.0, 0.01)


def revisited(rng, factor, drives=0.0, again=10):
    """100 poses of a machine, some visited again, with a factor on the declared noise and scatter of the carts."""
    machine, visits = draw(rng), np.concatenate([np.arange(100), np.arange(again)])
    asked, noise = commands(rng, 100)[visits], factor * SIGMAS * rng.standard_normal((len(visits), 6))
    moved = asked + drives * rng.standard_normal(asked.shape)
    return replace(measured(machine, moved, rng, noise=noise), q=asked, pose=visits)


def floors(found):
    return np.array([one.floor for one in found.by_instrument]) / np.sqrt(3.0)


@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 44), marks=pytest.mark.slow)], ids=["4", "40"])
@pytest.mark.study
def test_noise_alone_is_never_more_than_all_poses_show(seeds):
    """Few visits suggest a repeatability by chance; the residuals of 100 poses do not."""
    for seed in seeds:
        with warnings.catch_warnings():
            warnings.simplefilter("error", gtpin.GtpinWarning)
            found = gtpin.calibrate(revisited(np.random.default_rng([seed, 7]), 1.0))
        np.testing.assert_allclose(floors(found), [POSITION_SIGMA, ORIENTATION_SIGMA], rtol=0.1)
        for one in found.by_instrument:
            assert one.floor < 1.1 * one.after * np.sqrt(found.residual.size / found.dof)


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("seeds", [range(3), pytest.param(range(3, 23), marks=pytest.mark.slow)], ids=["3", "20"])
def test_a_sigma_that_visits_contradict_is_named_and_their_noise_is_told_of_positions_and_orientations(seeds):
    for seed in seeds:
        found = gtpin.calibrate(revisited(np.random.default_rng([seed, 8]), 4.0))
        for key in ("position_sigma", "orientation_sigma"):
            assert any(
                re.match(f"{key} is .* repeated visits show a noise of .* times more", t) for t in found.warnings
            )
        assert found.noise_known
        assert found.noise.repeatability == 0.0
        np.testing.assert_allclose(floors(found), [4.0 * POSITION_SIGMA, 4.0 * ORIENTATION_SIGMA], rtol=0.2)


@pytest.mark.parametrize("seed", quick_first(range(3)))
def test_scatter_of_the_carts_is_no_wrong_sigma(seed):
    data = revisited(np.random.default_rng([seed, 9]), 1.0, drives=4.0 * POSITION_SIGMA, again=60)
    with warnings.catch_warnings():
        warnings.simplefilter("error", gtpin.GtpinWarning)
        found = gtpin.calibrate(data)
    assert not found.noise.estimated.any()
    assert found.noise.repeatability == pytest.approx(4.0 * POSITION_SIGMA, rel=0.25)


def test_noise_alone_of_a_declared_sigma_that_is_a_little_too_large_is_what_the_residuals_allow():
    data = revisited(np.random.default_rng(10), 0.6, again=0)
    np.testing.assert_allclose(floors(gtpin.calibrate(data)), [0.6 * POSITION_SIGMA, 0.6 * ORIENTATION_SIGMA], rtol=0.2)


@pytest.mark.slow
def test_no_repeatability_is_invented_where_repeats_scatter_by_the_instrument_alone():
    def make(rng):
        machine, visits = draw(rng), np.repeat(np.arange(60), 2)
        return machine, measured(machine, commands(rng, 60)[visits], rng, pose=visits)

    found = study(make, MACHINES)
    claimed = sum(c.noise.repeatability > 0.0 for c in found.calibrations)
    # Documented chance: 2.5 % a dataset.
    assert claimed <= binom.isf(ONCE, MACHINES, 0.025)
    assert all(c.noise.repeatability < 10e-6 for c in found.calibrations)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.3, 1.0])
def test_a_station_tells_noise_along_the_line_of_sight_from_noise_across_it(ratio):
    station = np.array([1.5, -7.0, 0.3])

    def make(rng):
        machine, q = draw(rng), commands(rng, 120)
        T, _ = machine.seen(q)
        sight = T - station
        distance = np.linalg.norm(sight, axis=1)
        sight /= distance[:, None]
        # Of the declared root mean square over the axes at the mean range; across, noise grows with the distance.
        across = POSITION_SIGMA * np.sqrt(3.0 / (ratio**2 + 2.0))
        noise = rng.standard_normal((120, 6)) * [*[across] * 3, *[ORIENTATION_SIGMA] * 3]
        along = (noise[:, :3] * sight).sum(axis=1, keepdims=True) * sight
        noise[:, :3] = ratio * along + (distance / distance.mean())[:, None] * (noise[:, :3] - along)
        instrument = InstrumentSection(
            position_sigma=POSITION_SIGMA, orientation_sigma=ORIENTATION_SIGMA, station=tuple(station)
        )
        return machine, measured(machine, q, rng, noise=noise, instrument=instrument)

    found = study(make, 16)
    # The ratio comes from residuals that the fit has shrunk, along and across alike: 3 % for what is left of that.
    mean_is(np.log([c.noise.range_ratio for c in found.calibrations]), np.log(ratio), 0.03)
    found.assert_covers()
    found.assert_unbiased()
    mean_is([c.chi2_per_dof for c in found.calibrations], 1.0, 0.01)


@pytest.mark.slow
@pytest.mark.parametrize("declared", [True, False], ids=["declared", "undeclared"])
@pytest.mark.study
def test_heavy_tails_spoil_neither_values_nor_intervals(declared):
    def make(rng):
        machine = draw(rng)
        # A t distribution of 3 degrees of freedom, all six components of a pose at once, with the usual core.
        noise = SIGMAS * rng.standard_normal((120, 6)) / np.sqrt(rng.chisquare(3, (120, 1)) / 3)
        dataset = measured(machine, commands(rng, 120), rng, noise=noise)
        return machine, dataset if declared else undeclared(dataset)

    found = study(make, 16)
    found.assert_unbiased()
    # The tails' freedoms are themselves estimated from 120 poses: 1 % beside the spread.
    n = len(found.calibrations)
    spread = np.sqrt(0.0418**2 / n)  # of a machine's share: see test_calibration_coverage
    found.assert_covers(pooled=4.0 * spread + 0.01)
    assert np.mean([np.isfinite(c.freedom) for c in found.calibrations]) > 0.9
    assert np.mean([len(c.rejected) for c in found.calibrations]) < 1.0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("row", [40, 98])
@pytest.mark.parametrize("size", [5e-4, 1.3e-3, 4e-3])
def test_one_large_error_in_heavy_tails_is_no_bumped_instrument(size, row):
    """A motion of the frame has six numbers, and fits any one pose: between two steps it would be the whole reason."""
    for seed in range(4):
        rng = np.random.default_rng([seed, 3])
        machine = draw(rng)
        noise = SIGMAS * rng.standard_normal((120, 6)) / np.sqrt(rng.chisquare(3, (120, 1)) / 3)
        noise[row] = size / POSITION_SIGMA * SIGMAS * rng.choice([-1, 1], 6)
        found = gtpin.calibrate(measured(machine, commands(rng, 120), rng, noise=noise))
        assert np.isfinite(found.freedom)
        errors = found.model.geometry.deviation - [machine.deviations[n] for n in found.names]
        assert (np.abs(errors) < 5 * found.sigma).all()


def gross_case(seed, wrong=5, count=120):
    """A dataset of which some poses are off by 1 mm to 10 cm, and the same without these poses."""
    rng = np.random.default_rng([seed, 5])
    machine, q = draw(rng), commands(rng, count)
    noise = SIGMAS * rng.standard_normal((count, 6))
    clean = measured(machine, q, rng, noise=noise)
    bad = rng.choice(count, wrong, replace=False)
    direction = rng.standard_normal((wrong, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    position = clean.position.copy()
    position[bad] += direction * 10.0 ** rng.uniform(-3.0, -1.0, (wrong, 1))
    return replace(clean, position=position), clean.take(np.setdiff1d(np.arange(count), bad)), {str(i) for i in bad}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("declared", [True, False], ids=["declared", "undeclared"])
@pytest.mark.study
def test_gross_errors_are_set_aside_by_name_and_nothing_else_is(declared):
    good_lost = 0
    runs = 8
    for seed in range(runs):
        spoilt, clean, bad = gross_case(seed)
        if not declared:
            spoilt, clean = undeclared(spoilt), undeclared(clean)
        with pytest.warns(gtpin.GtpinWarning, match="gross") as told:
            found = gtpin.calibrate(spoilt)
        # A millimetre is 38 times the noise's length.
        assert bad <= set(found.rejected)
        assert all(name in str(told[0].message).replace(",", " ").split() for name in bad)
        good_lost += len(set(found.rejected) - bad)
        assert found.poses == 120 - len(found.rejected)
        if set(found.rejected) == bad:
            without = gtpin.calibrate(clean)
            assert (np.abs(found.values - without.values) <= 0.02 * without.sigma).all()
            np.testing.assert_allclose(found.sigma, without.sigma, rtol=0.01)
    # Documented: one dataset of a thousand loses a good pose.
    assert good_lost <= binom.isf(ONCE, runs, 1e-3)


@pytest.mark.slow
def test_gross_errors_of_positions_alone_are_set_aside():
    for seed in range(12):
        spoilt, _, bad = gross_case(seed, wrong=3, count=60)
        positions = replace(spoilt, orientation=None, instrument=InstrumentSection(position_sigma=POSITION_SIGMA))
        with pytest.warns(gtpin.GtpinWarning, match="gross"):
            assert bad <= set(gtpin.calibrate(positions).rejected)


@pytest.mark.parametrize("orientation", [True, False], ids=["poses", "positions"])
@pytest.mark.parametrize("free", [False, True], ids=["robot", "free"])
@pytest.mark.parametrize("size", quick_first([0.1, 1e200, 10.0, 1e4, 1e12], 2))
def test_gross_errors_of_any_size_are_set_aside(size, free, orientation):
    """From a slip of a decimetre to an overflowed cell, also where they must not mislead the guess of the frame."""
    rng = np.random.default_rng([int(np.log10(size)) + 5, free, orientation])
    _, clean = case(rng, 60, free=free, orientation=orientation)
    position = clean.position.copy()
    position[[7, 20, 33]] += size * rng.choice([-1.0, 1.0], (3, 3)) * rng.uniform(0.3, 1.0, (3, 3))
    with pytest.warns(gtpin.GtpinWarning, match="gross"), np.errstate(over="ignore"):
        found = gtpin.calibrate(replace(clean, position=position))
    assert {"7", "20", "33"} <= set(found.rejected)
    assert len(found.rejected) <= 4  # one more is an accident of one dataset in a thousand, two do not happen
    assert abs(found.chi2_per_dof - 1.0) < 4.5 * np.sqrt(2.0 / found.dof)


def test_gross_errors_of_orientation_and_of_commands_are_set_aside():
    _, clean = case(np.random.default_rng(8), 120)
    quaternion, wrong_q = clean.orientation.copy(), clean.q.copy()
    quaternion[3] = quaternion[3][[0, 2, 1, 3]]  # components that were swapped
    wrong_q[7, 1] += 0.01  # a typing error of a centimetre
    with pytest.warns(gtpin.GtpinWarning, match="3, 7"):
        assert {"3", "7"} <= set(gtpin.calibrate(replace(clean, q=wrong_q, orientation=quaternion)).rejected)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("declared", [True, False], ids=["declared", "undeclared"])
@pytest.mark.parametrize("nominal", [False, True], ids=["drawn", "nominal"])
@pytest.mark.parametrize("repeats", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_data_without_noise_are_fitted_closely(declared, nominal, repeats, seed):
    rng = np.random.default_rng(seed)
    machine, visits = draw(rng), np.arange(80)
    if repeats:
        visits = np.concatenate([visits, np.arange(20)])
    if nominal:
        machine = type(machine)(GANTRY, dict.fromkeys(machine.deviations, 0.0))
    tiny = InstrumentSection(position_sigma=1e-9, orientation_sigma=1e-9)
    q = commands(rng, 80)
    dataset = measured(machine, q[visits], rng, noise=np.zeros((len(visits), 6)), pose=visits, instrument=tiny)
    found = gtpin.calibrate(dataset if declared else undeclared(dataset))
    asked = commands(rng, 50)
    T, _ = machine.seen(asked)
    assert np.abs(found.model.predict(asked).T - T).max() < 1e-6
    assert np.isfinite(found.sigma).all()
    assert np.isfinite(found.chi2_per_dof)


@pytest.mark.slow
def test_noise_larger_than_declared_enlarges_the_sigmas():
    def make(rng):
        machine = draw(rng)
        noise = 2.0 * SIGMAS * rng.standard_normal((100, 6))
        return machine, measured(machine, commands(rng, 100), rng, noise=noise)

    found = study(make, MACHINES)
    mean_is([c.sigma_scale for c in found.calibrations], 2.0, 0.01)
    # A lack of fit is told, not hidden in the noise: chi-square stays what the declared noise makes it.
    assert_chi2(sum(c.chi2 for c in found.calibrations) / 4.0, sum(c.dof for c in found.calibrations))
    found.assert_covers()


def wrong_by_pose(seed, visits, freedom):
    """A machine with an error of 2 sigma (of a t distribution) that is fixed at each of 100 poses, and its measurement."""
    rng = np.random.default_rng(seed)
    machine, q = draw(rng), commands(rng, 100)
    scale = rng.chisquare(freedom, (100, 1)) / freedom if np.isfinite(freedom) else 1.0
    fixed = 2.0 * SIGMAS * rng.standard_normal((100, 6)) / np.sqrt(scale)
    pose = np.repeat(np.arange(100), visits)
    noise = fixed[pose] + SIGMAS * rng.standard_normal((len(pose), 6))
    return measured(machine, q[pose], rng, noise=noise, pose=pose)


def ratio_of_sigmas(one, two):
    """The ratio of two calibrations' sigmas, for parameters that the data determine, not the priors."""
    known = two.sigma < 0.3 * np.array([tolerance(name) for name in two.names])
    assert known.sum() > 5
    return np.median(one.sigma[known] / two.sigma[known])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize(("blank", "freedom"), [(False, np.inf), (True, np.inf), (False, 2.5)])
def test_visits_of_the_same_poses_say_no_more_of_errors_that_repeat(blank, freedom):
    """With v visits the mean of a pose has the variance 4 + 1 / v."""
    ratios = []
    for seed in range(3):
        data = [wrong_by_pose(seed, visits, freedom) for visits in (3, 1)]
        ratios.append(ratio_of_sigmas(*(gtpin.calibrate(undeclared(one) if blank else one) for one in data)))
    expected = np.sqrt((4.0 + 1.0 / 3.0) / (4.0 + 1.0))
    # The size of the errors is estimated from some 550 numbers: to 3 % in each of the two fits; heavy tails make it rougher.
    assert np.mean(ratios) == pytest.approx(expected, abs=0.04 if np.isinf(freedom) else 0.12)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_heavy_tails_count_the_same_with_noise_that_is_declared_and_with_noise_that_visits_show():
    data = wrong_by_pose(0, 3, 2.5)
    found = gtpin.calibrate(undeclared(data))
    assert found.noise.source == "repeats"
    assert ratio_of_sigmas(found, gtpin.calibrate(data)) == pytest.approx(1.0, abs=0.1)


def test_the_likelihood_of_repeats_has_its_maximum_where_that_of_all_contrasts_has_it():
    rng = np.random.default_rng(0)
    J = rng.standard_normal((20, 6, 3))[np.repeat(np.arange(20), 30)]
    truth = 1e-6**2 * np.diag([9.0, 9.0, 9.0, 25.0, 25.0, 25.0]) + 4e-12 * J @ np.swapaxes(J, 1, 2)
    contrast = np.einsum("nij,nj->ni", np.linalg.cholesky(truth), rng.standard_normal((len(J), 6)))
    group = np.broadcast_to([0, 0, 0, 1, 1, 1], contrast.shape)
    start = ReadingNoise(np.ones(2), group, np.full(contrast.shape, np.nan), np.ones(2, dtype=bool))
    found = from_repeats(start, contrast, J)
    short = tamed(contrast, group)

    def log_likelihood(position, orientation, drives):
        own = np.repeat([position**2, orientation**2], 3) * np.eye(6)
        each = own + drives**2 * J[::30] @ np.swapaxes(J[::30], 1, 2)
        parts = zip(each, short.reshape(20, 30, 6), strict=True)
        return sum(multivariate_normal.logpdf(part, cov=one, allow_singular=False).sum() for one, part in parts)

    at = np.array([*found.sigma, found.repeatability])
    assert at == pytest.approx([3e-6, 5e-6, 2e-6], rel=0.1)
    best = log_likelihood(*at)
    for k in range(3):
        for factor in (0.99, 1.01):
            assert log_likelihood(*np.where(np.arange(3) == k, factor * at, at)) < best


@pytest.mark.parametrize("c", [1, 3, 6])
def test_shortened_contrasts_keep_the_mean_square_of_gaussian_ones(c):
    contrast = 3.0 * np.random.default_rng(c).standard_normal((40_000, c))
    mean = (tamed(contrast, np.zeros(contrast.shape, dtype=int)) ** 2).mean()
    assert mean == pytest.approx(9.0, rel=4.0 * np.sqrt(2.0 / 40_000))


def test_no_sigma_exceeds_its_tolerance():
    machine = draw(np.random.default_rng(1))
    found = gtpin.calibrate(measured(machine, commands(np.random.default_rng(1), 30), np.random.default_rng(2)))
    assert (found.sigma <= [tolerance(name) * (1 + 1e-9) for name in found.names]).all()
    assert chi2.sf(found.chi2, found.dof) > ONCE
