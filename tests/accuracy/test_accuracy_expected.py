"""Expected errors, against machines that are actually disturbed, and against recalibrations."""

import numpy as np
import pytest
from accuracy_machines import MODEL, ROBOT, commands, drawn_measurements

import gtpin
from gtpin.accuracy.expected import ErrorResponse, Uncertainty, expected_error, expected_of, mean_length, response
from gtpin.errors import ModelError

Q = commands(25, seed=1)


def test_mean_length_is_that_of_drawn_vectors() -> None:
    rng = np.random.default_rng(0)
    roots = rng.standard_normal((6, 3, 3)) * np.array([1.0, 0.3, 0.01])
    drawn = np.linalg.norm(np.einsum("nij,mj->nmi", roots, rng.standard_normal((200_000, 3))), axis=2)
    np.testing.assert_allclose(mean_length(roots @ np.swapaxes(roots, 1, 2)), drawn.mean(axis=1), rtol=0.01)


def test_mean_length_of_one_and_of_three_equal_sigmas_is_the_textbooks() -> None:
    """Half-normal and Maxwell distributions."""
    covariance = np.array([np.diag([0.0, 0.0, 4.0]), 9.0 * np.eye(3)])
    np.testing.assert_allclose(
        mean_length(covariance), [2.0 * np.sqrt(2 / np.pi), 3.0 * np.sqrt(8 / np.pi)], rtol=1e-12
    )


@pytest.mark.slow
def test_errors_by_tolerances_are_those_of_machines_off_by_them() -> None:
    geometry = MODEL.geometry
    tolerance = 0.05 * geometry.tolerance
    expected = expected_error(MODEL, Q, Uncertainty(np.diag(tolerance**2)), draws=4000)
    assert expected.orientation is not None
    rng = np.random.default_rng(2)
    off = []
    for _ in range(150):
        machine = gtpin.Model(geometry.with_values(geometry.values + tolerance * rng.standard_normal(len(tolerance))))
        off.append(machine.predict(Q).minus(MODEL.predict(Q)))
    for part, error in ((slice(0, 3), expected.position), (slice(3, 6), expected.orientation)):
        lengths = np.linalg.norm(np.array(off)[:, :, part], axis=2)
        assert error.mean == pytest.approx(lengths.mean(), rel=0.1)
        assert error.p95 == pytest.approx(np.quantile(lengths, 0.95), rel=0.12)
        assert error.maximum == pytest.approx(lengths.max(axis=1).mean(), rel=0.1)
        np.testing.assert_allclose(error.at, lengths.mean(axis=0), rtol=0.15)


@pytest.mark.slow
def test_errors_by_closure_residuals_are_those_of_drawn_measurements() -> None:
    sigmas = np.array([2e-4, 1.7e-4, 1.6e-4, 8e-5, 7e-5, 9e-5])
    expected = expected_error(MODEL, Q, Uncertainty(closures=sigmas), visits=10)
    drawn = [drawn_measurements(MODEL, Q, sigmas, seed).minus(MODEL.predict(Q)) for seed in range(200)]
    lengths = np.linalg.norm(np.array(drawn)[:, :, :3], axis=2)
    assert expected.position.mean == pytest.approx(lengths.mean(), rel=0.03)
    assert expected.position.p95 == pytest.approx(np.quantile(lengths, 0.95), rel=0.03)
    rng = np.random.default_rng(3)
    largest = [length[rng.choice(25, 10, replace=False)].max() for length in lengths for _ in range(5)]
    assert expected.position.maximum == pytest.approx(np.mean(largest), rel=0.05)


@pytest.mark.slow
def test_repeatability_is_that_of_scattered_commands() -> None:
    expected = expected_error(MODEL, Q, Uncertainty(repeatability=1e-5))
    rng = np.random.default_rng(4)
    scattered = [MODEL.predict(Q + 1e-5 * rng.standard_normal(Q.shape)).minus(MODEL.predict(Q)) for _ in range(100)]
    lengths = np.linalg.norm(np.array(scattered)[:, :, :3], axis=2)
    assert expected.position.mean == pytest.approx(lengths.mean(), rel=0.04)


@pytest.mark.slow
def test_a_calibrations_covariance_foretells_the_error_of_recalibrated_models() -> None:
    from gtpin.bench.simulator.simulate import simulate

    at = commands(30, seed=5)
    foretold, found = [], []
    for seed in range(6):
        simulation = simulate(ROBOT, "gantry_tau", poses=60, seed=seed)
        calibration = gtpin.calibrate(simulation.dataset)
        foretold.append(
            expected_error(calibration.model, at, Uncertainty(calibration.covariance), draws=10).position.mean
        )
        off = calibration.model.predict(at).minus(simulation.machine.predict(at))
        found.append(np.linalg.norm(off[:, :3], axis=1).mean())
    assert np.mean(found) == pytest.approx(np.mean(foretold), rel=0.35)


def test_uncertainties_add_in_squares() -> None:
    both = response(MODEL, Q, Uncertainty(np.diag(MODEL.geometry.tolerance**2), np.full(6, 1e-4), 1e-5)).covariance
    parts = (
        Uncertainty(np.diag(MODEL.geometry.tolerance**2)),
        Uncertainty(closures=np.full(6, 1e-4)),
        Uncertainty(repeatability=1e-5),
    )
    np.testing.assert_allclose(both, sum(response(MODEL, Q, part).covariance for part in parts), rtol=1e-9, atol=1e-18)


def test_same_seed_same_numbers_and_nothing_uncertain_no_error() -> None:
    known = Uncertainty(closures=np.full(6, 1e-4))
    assert expected_error(MODEL, Q, known, seed=3).position.p95 == expected_error(MODEL, Q, known, seed=3).position.p95
    assert expected_error(MODEL, Q, Uncertainty()).position.maximum == 0.0


@pytest.mark.slow
def test_more_visits_than_poses_go_round_again() -> None:
    one = ErrorResponse(np.zeros((2, 3, 0)), np.tile(np.eye(3), (2, 1, 1)))
    few, many = (expected_of(one, visits=visits).position.maximum for visits in (2, 200))
    assert many > few


def test_uncertainties_of_another_size_are_refused() -> None:
    with pytest.raises(ModelError, match="covariance of shape"):
        response(MODEL, Q, Uncertainty(np.eye(3)))
    with pytest.raises(ModelError, match="closure sigmas"):
        response(MODEL, Q, Uncertainty(closures=np.ones(2)))
    with pytest.raises(ModelError, match="visits"):
        expected_error(MODEL, Q, Uncertainty(), visits=0)
