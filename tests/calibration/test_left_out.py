"""Errors at left-out poses against fits that were made without these poses, and what is unexplained between poses."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import gtpin
from gtpin.calibration.fit_state import unexplained_by
from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.left_out import of_poses
from gtpin.extras.certificate.held_against import root_of
from gtpin.model.fit_conditions import ModelDiscrepancy
from gtpin.model.model_folder import read_model, write_model

EXAMPLES = Path(__file__).parents[2] / "examples" / "certificate"
if not EXAMPLES.is_dir():
    pytest.skip("needs the examples", allow_module_level=True)
sys.path.insert(0, str(EXAMPLES))

from unseen_poses import Machine  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


def test_left_out_residuals_are_those_of_fits_without_the_pose():
    rng = np.random.default_rng(0)
    poses = rng.permutation(np.repeat(np.arange(7), [1, 2, 3, 1, 1, 2, 4]))
    J, y = rng.standard_normal((len(poses), 3, 5)), rng.standard_normal((len(poses), 3))

    def solved(rows):
        flat = J[rows].reshape(-1, 5)
        return np.linalg.solve(flat.T @ flat + np.eye(5), flat.T @ y[rows].ravel())

    every = np.ones(len(poses), dtype=bool)
    root = np.linalg.cholesky(np.linalg.inv(J.reshape(-1, 5).T @ J.reshape(-1, 5) + np.eye(5)))
    found = of_poses(J @ root, y - J @ solved(every), poses)
    for pose in range(7):
        own = poses == pose
        np.testing.assert_allclose(found[own], y[own] - J[own] @ solved(~own), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_a_calibration_states_the_error_of_calibrations_without_each_pose():
    data = Machine(11).measured(0, 2, False)
    data = data.take(slice(0, 40))  # 20 poses
    squares = []
    for pose in dict.fromkeys(data.pose):
        own = data.pose == pose
        model = gtpin.calibrate(data.take(~own)).model
        squares.append(((data.position[own] - model.predict(data.q[own]).T) ** 2).sum(axis=1).mean())
    found = gtpin.calibrate(data).to_json()
    assert found["position_rms_left_out"] == pytest.approx(np.sqrt(np.mean(squares)), rel=0.1)
    assert found["position_rms_left_out"] > 1.05 * found["position_rms_after"]


@pytest.mark.parametrize("visits", [1, 5])
def test_visits_that_agree_do_not_make_a_model_right(visits):
    """Errors of 40 um between poses, visits that agree to 1 um; 10 of 300 numbers fitted."""
    rng = np.random.default_rng(visits)
    between = 4e-5 * rng.standard_normal(300)
    errors = np.repeat(between, visits) + 1e-6 * rng.standard_normal(300 * visits)
    one = np.zeros((300 * visits, 1), dtype=int)
    measured = SimpleNamespace(
        q=np.repeat(np.arange(300), visits)[:, None],
        read=one[:, 0],
        counted=one + 1.0,
        group=one,
        group_turns=one[0] > 0,
    )

    def left(errors, effective_parameters, known):
        fit = SimpleNamespace(
            problem=SimpleNamespace(measured=measured),
            residual=errors[:, None] / 1e-6,
            effective_parameters=effective_parameters,
        )
        return unexplained_by(fit, errors[:, None], one + 1e-12, known=known, dof=np.inf)

    found = left(errors, 10.0, True)
    assert found.position == pytest.approx(4e-5, rel=0.2)
    assert found.orientation == 0.0
    clean = errors - np.repeat(between, visits)
    assert left(clean, 0.0, True).none
    assert not left(clean, 0.0, False).none


@pytest.mark.parametrize(("ratio", "known"), [(0.0, True), (0.5, True), (1.0, True), (3.0, True), (1.0, False)])
def test_the_interval_of_what_is_unexplained_has_95_percent(ratio, known):
    """Sixty poses, whose positions alone depend on 40 parameters; errors of so many sigmas of their noise from pose to pose."""
    rng, n, sigma = np.random.default_rng(0), 60, np.repeat([1.5e-5, 5e-5], 3)
    group = np.tile(np.repeat([0, 1], 3), (n, 1))
    measured = SimpleNamespace(
        q=np.arange(float(n))[:, None],
        read=np.zeros(n, dtype=int),
        counted=np.ones((n, 6)),
        group=group,
        group_turns=np.array([False, True]),
    )
    J = np.zeros((n, 6, 40))
    J[:, :3] = np.linalg.qr(rng.standard_normal((3 * n, 40)))[0].reshape(n, 3, 40)
    inside, true = [], ratio * sigma[0]
    for _ in range(400):
        errors = rng.standard_normal((n, 6)) * np.hypot(sigma, [true] * 3 + [0.0] * 3)
        whitened = (errors / sigma).reshape(-1)
        left = (whitened - J.reshape(-1, 40) @ (J.reshape(-1, 40).T @ whitened)).reshape(n, 6)
        fit = SimpleNamespace(
            problem=SimpleNamespace(measured=measured, jacobian=lambda point, rows, weight: J[rows]),
            point=None,
            weight=np.ones(n),
            root=np.eye(40),
            effective_parameters=40.0,
            residual=left,
        )
        found = unexplained_by(fit, left * sigma, np.tile(sigma**2, (n, 1)), known=known, dof=np.inf)
        least, most = found.interval
        assert least <= found.position <= most
        inside.append(least <= true <= most)
    assert np.mean(inside) > 0.92
    assert found.interval[0] > 0.0 or not (known and ratio > 1.0)
    assert most < 1.5 * np.hypot(true, sigma[0])  # not by an interval of any width


def test_models_of_older_versions_state_what_they_know_of_the_unexplained():
    assert ModelDiscrepancy(2e-5, 0.0).interval == (2e-5, 2e-5)
    assert ModelDiscrepancy(2e-5, 0.0, False).interval == (0.0, 2e-5)


@pytest.mark.slow
def test_the_file_of_a_model_has_what_it_left_unexplained_and_older_files_do_without(tmp_path):
    model = gtpin.calibrate(Machine(12).measured(0, 3, True)).model
    true = Machine(12).waves[2].std() * np.sqrt(len(Machine(12).waves[2]) / 2.0)
    assert model.unexplained.position == pytest.approx(true, rel=0.35)
    for one in (model, replace(model, unexplained=None)):
        write_model(one, tmp_path / "model", force=True)
        assert read_model(tmp_path / "model").unexplained == one.unexplained


def test_what_small_noise_determines_has_a_small_variance_in_the_covariance():
    """The variance of a fitted number can't exceed that of its noise, however wide the priors of the unknowns are."""
    rng = np.random.default_rng(1)
    J = rng.standard_normal((200, 30)) @ np.diag(10.0 ** rng.uniform(-1.0, 5.0, 30)) @ rng.standard_normal((30, 60))
    fit = Fit(SimpleNamespace(prior=np.ones(60)), None, None, None, J.T @ J, 1)  # type: ignore[arg-type]
    for root in (fit.root, root_of(fit.covariance)):
        leverage = ((J @ root) ** 2).sum(axis=1)
        assert leverage.max() < 1.0 + 1e-3
        assert leverage.sum() == pytest.approx(30.0, rel=1e-2)


def test_rounding_does_not_turn_the_root_of_a_covariance():
    """Signs and directions of eigenvectors are arbitrary, and draws from a posterior should not be."""
    rng = np.random.default_rng(2)
    sigma = 10.0 ** rng.uniform(-6.0, 0.0, 8)
    for correlation in (np.eye(8), np.eye(8) + 0.5 * (np.ones((8, 8)) - np.eye(8))):  # of equal eigenvalues
        covariance = correlation * np.outer(sigma, sigma)
        rounded = covariance * (1.0 + 1e-15 * rng.standard_normal((8, 8)))
        first, second = root_of(covariance), root_of((rounded + rounded.T) / 2.0)
        assert first @ first.T == pytest.approx(covariance, rel=1e-9)
        assert (np.abs(first - second) / sigma[:, None]).max() < 1e-9
