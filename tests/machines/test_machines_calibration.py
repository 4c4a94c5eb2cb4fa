"""Each shipped machine calibrates: parameters come back, and intervals cover what they say."""

import warnings
from functools import cache

import numpy as np
import pytest
from closures import NAMES, POSITION_SIGMA, nominal
from scipy.stats import binom, chi2

import gtpin

pytestmark = pytest.mark.slow

MACHINES, POSES = 10, 60
ONCE = 1e-4
"""Chance that a bound fails where everything is right."""


@cache
def study(name: str) -> list[tuple[gtpin.Calibration, np.ndarray, np.ndarray]]:
    """Calibrations, the deviations that the machines have, and held-out position errors (20, 3), m."""
    found = []
    for seed in range(MACHINES):
        rng = np.random.default_rng([seed, len(name)])
        closures = nominal(name)
        tolerance = closures.parameters()
        # Jugglebot's tolerances are wide: a machine within half of them can still go to all commands.
        size = 0.5 if name == "stewart_jugglebot" else 1.0
        true = {key: size * value * rng.standard_normal() for key, value in tolerance.items()}
        machine = closures.off(true)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", gtpin.GtpinWarning)
            calibration = gtpin.calibrate(machine.measured(machine.in_range(rng, POSES), rng))
        q = machine.in_range(rng, 20)
        off = calibration.model.predict(q).T - machine.follow(q, 0.02)[0]
        found.append((calibration, np.array([true[key] for key in calibration.names]), off))
    return found


@pytest.mark.parametrize("name", NAMES)
def test_the_default_set_is_that_of_the_machine_s_parts(name: str) -> None:
    calibration = study(name)[0][0]
    assert list(calibration.names) == list(nominal(name).parameters())
    tolerances = calibration.model.geometry.tolerance
    np.testing.assert_allclose(tolerances, list(nominal(name).parameters().values()), rtol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_parameters_are_recovered_and_95_percent_intervals_cover(name: str) -> None:
    if name == "stewart_jugglebot":
        pytest.skip("its machines are drawn from half the tolerances, which priors count as too careful")
    z = np.array([(c.model.geometry.deviation - true) / c.sigma for c, true, _ in study(name)])
    n, p = z.shape
    inside = np.abs(z) < 1.959964
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(np.zeros(p), study(name)[0][0].correlation, size=2000, check_valid="ignore")
    spread = (np.abs(draws) < 1.959964).mean(axis=1).std() / np.sqrt(n)
    assert abs(inside.mean() - 0.95) < 4.0 * spread, (inside.mean(), spread)
    assert inside.sum(axis=0).min() >= binom.ppf(ONCE / p, n, 0.95)
    whitened = sum(
        float((c.model.geometry.deviation - true) @ np.linalg.solve(c.covariance, c.model.geometry.deviation - true))
        for c, true, _ in study(name)
    )
    assert chi2.ppf(ONCE / 2, n * p) < whitened < chi2.isf(ONCE / 2, n * p), whitened / (n * p)


@pytest.mark.parametrize("name", NAMES)
def test_the_fit_leaves_noise_and_predicts_new_poses_to_less_than_noise(name: str) -> None:
    found = study(name)
    total, freedoms = sum(c.chi2 for c, _, _ in found), sum(c.dof for c, _, _ in found)
    assert chi2.ppf(ONCE / 2, freedoms) < total < chi2.isf(ONCE / 2, freedoms), total / freedoms
    off = np.array([np.sqrt((off**2).sum(axis=1).mean()) for _, _, off in found])
    assert np.median(off) < np.sqrt(3.0) * POSITION_SIGMA
