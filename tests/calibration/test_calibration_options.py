"""Which parameters a calibration identifies, and with which tolerances."""

from dataclasses import replace

import numpy as np
import pytest
from monte_carlo import study
from quick_first import quick_first
from virtual_gantry import ROBOT, case, names

import gtpin
from gtpin.errors import ConvergenceError, DatasetError, GtpinError, GtpinWarning


@pytest.fixture(scope="module")
def dataset():
    return case(np.random.default_rng(0), 60)[1]


@pytest.fixture(scope="module")
def usual(dataset):
    return gtpin.calibrate(dataset)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "count"),
    [
        ({"directions": "rod"}, 54),
        ({"scale": "actuator"}, 51),
        ({"scale": "rod"}, 54),
        ({"directions": "rod", "scale": "rod"}, 60),
    ],
    ids=str,
)
def test_options_add_parameters_that_are_identified_as_well(options, count):
    drawn = names(options.get("directions", "actuator"), options.get("scale"))
    assert len(drawn) == count
    found = study(lambda rng: case(rng, 80, drawn), 20, **options)
    assert sorted(found.calibrations[0].names) == sorted(drawn)
    found.assert_covers()
    found.assert_unbiased()
    found.assert_fits()


def test_parameters_left_out_stay_nominal():
    drawn = [name for name in names() if not name.startswith(("track_direction", "length[2a]"))]
    found = gtpin.calibrate(case(np.random.default_rng(4), 80, drawn)[1], without=["track_direction", "length[2a]"])
    assert sorted(found.names) == sorted(drawn)
    kinematics, q = found.model.kinematics, ROBOT.home_q + 0.1 * np.arange(2)[:, None]
    on_platform, on_carriers = kinematics.rod_ends(q, kinematics.forward(q))
    rod = next(rod for rod in ROBOT.rods if rod.name == "2a")
    np.testing.assert_allclose(np.linalg.norm(on_platform - on_carriers, axis=2)[:, 1], rod.L, rtol=0.0, atol=1e-13)
    axes = [ROBOT.actuators[rod.carrier].axis for rod in ROBOT.rods]
    np.testing.assert_allclose(np.diff(on_carriers, axis=0)[0], 0.1 * np.array(axes), atol=1e-15)
    assert abs(found.chi2_per_dof - 1.0) < 5.0 * np.sqrt(2.0 / found.dof)


@pytest.mark.slow
def test_what_was_left_out_wrongly_shows_as_a_lack_of_fit(dataset):
    found = gtpin.calibrate(dataset, without=["track_direction"])
    assert found.chi2_per_dof > 2.0
    assert found.sigma_scale == pytest.approx(np.sqrt(found.chi2_per_dof)) or np.isfinite(found.freedom)


def test_a_name_that_is_no_parameter_is_refused(dataset):
    with pytest.raises(GtpinError, match=r"length\[9z\]"):
        gtpin.calibrate(dataset, without=["length[9z]"])


def test_the_dataset_s_tolerances_override_the_robot_s(dataset, usual):
    def of_kind(found, values, kind):
        return [value for name, value in zip(found.names, values, strict=True) if name.startswith(kind)]

    tight = gtpin.calibrate(replace(dataset, tolerance={"platform_joint": 1e-6}))
    for found, kind, size in ((tight, "platform", 1e-6), (usual, "platform", 1e-3), (tight, "cart_joint", 2e-3)):
        assert set(of_kind(found, found.model.geometry.tolerance, kind)) == {size}
    off, other = (np.abs(of_kind(c, c.model.geometry.deviation, "platform")).max() for c in (tight, usual))
    assert off < 1e-4 < other


def test_a_tolerance_of_unknown_kind_is_refused(dataset):
    with pytest.raises(GtpinError, match="belt_length"):
        gtpin.calibrate(replace(dataset, tolerance={"belt_length": 1e-3}))


@pytest.mark.slow
def test_a_tolerance_of_a_kind_that_the_robot_has_not_is_warned_of_with_those_it_has(dataset):
    with pytest.warns(GtpinWarning, match="is of the kind placement_position .*; it has link_length, platform_joint, "):
        gtpin.calibrate(replace(dataset, tolerance={"placement_position": 1e-3, "link_length": 1e-3}))


@pytest.mark.slow
def test_fewer_numbers_than_parameters_are_fitted_within_tolerances_or_refused_for_that():
    assert gtpin.calibrate(case(np.random.default_rng(0), 8)[1]).dof > 1.0
    with pytest.raises(DatasetError, match="6 measured numbers leave"):
        gtpin.calibrate(case(np.random.default_rng(0), 2, orientation=False)[1])


@pytest.mark.slow
@pytest.mark.parametrize("count", [9, 12, 20])
def test_few_poses_are_no_reason_to_claim_more_than_is_known(count):
    found = study(lambda rng: case(rng, count), 25)
    found.assert_covers()
    found.assert_fits()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_poses_of_another_machine_do_not_converge_in_silence(dataset):
    shuffled = replace(dataset, q=np.random.default_rng(0).permutation(dataset.q))
    try:
        found = gtpin.calibrate(shuffled)
    except (ConvergenceError, DatasetError):
        return
    # What comes out all the same says that it does not fit.
    assert found.chi2_per_dof > 100 or len(found.rejected) > 10


@pytest.mark.parametrize(
    ("iteration", "words"), quick_first([("robust_fit", "converged in 1"), ("gauss_newton", "not converged")])
)
def test_an_iteration_limit_that_is_hit_is_an_error(dataset, monkeypatch, iteration, words):
    monkeypatch.setattr(f"gtpin.calibration.{iteration}.MAX_ITERATIONS", 1)
    with pytest.raises(ConvergenceError, match=words):
        gtpin.calibrate(dataset)


@pytest.mark.slow
def test_it_takes_few_steps_from_nominal():
    for seed in range(10):
        steps, data = [], case(np.random.default_rng(seed), 60)[1]
        gtpin.calibrate(data, progress=lambda _, iteration, size, steps=steps: steps.append(iteration))
        assert max(steps) <= 8
        assert len(steps) <= 20


def test_the_order_of_the_rows_means_nothing(dataset, usual):
    again = gtpin.calibrate(dataset.take(np.random.default_rng(0).permutation(len(dataset))))
    assert (np.abs(again.values - usual.values) <= 1e-6 * usual.sigma).all()
    np.testing.assert_allclose(again.sigma, usual.sigma, rtol=1e-7)
