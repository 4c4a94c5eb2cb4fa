"""The identification regressor of a calibration, its base parameters, and the history of its iterations."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from monte_carlo import assert_chi2
from scipy.spatial.transform import Rotation
from virtual_arm import Arm
from virtual_gantry import GANTRY, ORIENTATION_SIGMA, POSITION_SIGMA, case, tolerance

import gtpin

STEP = 1e-6
SIGMAS = (2e-5, 5e-5)


@pytest.fixture(scope="module")
def gantry() -> gtpin.Calibration:
    return gtpin.calibrate(case(np.random.default_rng(0), 40)[1])


def test_its_columns_are_the_derivatives_of_the_closures_in_sigmas(gantry: gtpin.Calibration) -> None:
    found = gantry.regressor
    assert found.columns == gantry.names
    used = gantry.used(gantry.dataset)
    assert found.rows[:7] == (
        *tuple((gantry.row_poses[0], name) for name in ("x", "y", "z", "rx", "ry", "rz")),
        (gantry.row_poses[1], "x"),
    )
    at = dict(zip(gantry.names, gantry.model.geometry.deviation, strict=True))
    q, sigma = gantry.dataset.q[used], np.repeat([POSITION_SIGMA, ORIENTATION_SIGMA], 3)
    for name in ("length[2a]", "platform_joint[3b].y", "cart_joint[1].z", "track_direction[cart2].b"):
        (T, R), (Tb, Rb) = (GANTRY.off(at | {name: at[name] + h}).poses(q) for h in (STEP, -STEP))
        turn = Rotation.from_matrix(R @ np.swapaxes(Rb, 1, 2)).as_rotvec()
        expected = np.hstack([T - Tb, turn]) / (2.0 * STEP) / sigma
        column = found.J[:, found.columns.index(name)].reshape(-1, 6)
        np.testing.assert_allclose(column, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def test_at_the_fit_the_pull_of_the_data_is_that_of_the_priors(gantry: gtpin.Calibration) -> None:
    found = gantry.regressor
    np.testing.assert_allclose(found.prior, [tolerance(name) for name in gantry.names])
    pull = found.prior * (found.J.T @ found.residual)
    np.testing.assert_allclose(pull, gantry.model.geometry.deviation / found.prior, rtol=0, atol=1e-3)
    table = found.to_dataframe()
    assert table.shape == found.J.shape
    assert table.loc[("0", "x"), "length[1]"] == found.J[0, 0]


def ur5(seed: int, *, free: bool) -> tuple[Arm, gtpin.Calibration]:
    rng = np.random.default_rng([seed, 11])
    machine = Arm.drawn(rng, 5e-4, tool=True)
    dataset = machine.measured(rng.uniform(-2.0, 2.0, (50, 6)), rng, SIGMAS, free=free)
    return machine, gtpin.calibrate(dataset)


@pytest.mark.parametrize("free", [False, True])
def test_an_arm_of_six_turning_joints_has_as_many_base_parameters_as_the_theory_says(free: bool) -> None:
    """4 for each turning joint and 6 of the tool (Everett, Driels and Mooring 1987); 6 less where the frame is free too."""
    found = ur5(0, free=free)[1]
    assert len(found.names) == 42
    assert len(found.base_parameters) == (24 if free else 30)
    if free:
        assert found.regressor.columns[-6:] == tuple(f"frame.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz"))


@pytest.mark.slow
def test_base_parameters_are_known_where_the_parameters_in_them_are_not_and_their_sigmas_hold() -> None:
    total = 0.0
    for seed in range(15):
        machine, found = ur5(seed, free=False)
        sums = found.base_parameters
        weights = np.array([[one.terms.get(name, 0.0) for name in found.names] for one in sums])
        true = weights @ [machine.deviations[name] for name in found.names]
        error = np.array([one.value for one in sums]) - true
        total += float(error @ np.linalg.solve(weights @ found.covariance @ weights.T, error))
        assert all(one.terms[one.name] == 1.0 for one in sums)
        assert 5.0 * max(one.sigma for one in sums) < found.sigma.max()
    assert_chi2(total, 15 * 30)


def test_the_history_has_the_steps_that_progress_tells_and_ends_at_the_noise(gantry: gtpin.Calibration) -> None:
    told: list[tuple[str, int, float]] = []
    again = gtpin.calibrate(gantry.dataset, progress=lambda *step: told.append(step))
    assert again.history == gantry.history == tuple(told)
    assert again.history[0].fit == "rough fit"
    assert again.history[0].rms > 10.0 * again.history[-1].rms
    assert again.history[-1].rms == pytest.approx(1.0, abs=0.3)


def test_a_calibration_that_was_pickled_is_the_same(gantry: gtpin.Calibration) -> None:
    again = pickle.loads(pickle.dumps(gantry))
    assert (again.regressor.J == gantry.regressor.J).all()
    assert replace(again, history=()).history == ()
