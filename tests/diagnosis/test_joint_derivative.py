"""The derivative of an arm's joint fit by deviations of the travel is that of the exact prediction."""

import warnings
from typing import Any

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.diagnosis.inference import joint_fit

pytestmark = pytest.mark.slow

STEP = 1e-3
"""In sigmas of the priors."""
ENERGY = 2e5
"""Energy of the effects: deviations of some mrad, which change the derivative itself by more than the bound below."""


def test_the_derivative_of_an_arms_joint_fit_is_that_of_finite_differences(monkeypatch):
    effects = [("rack_periodic", "elbow_joint"), ("linearity", "shoulder_lift_joint")]
    fits: list[Any] = []

    def recorded(*arguments: Any, **options: Any) -> Any:
        fits.append(fit(*arguments, **options))
        return fits[-1]

    fit = joint_fit.fit
    monkeypatch.setattr(joint_fit, "fit", recorded)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        gtpin.diagnose(make_case(31, effects=effects, energy=ENERGY, poses=80, robot="ur5").dataset)
    found = fits[-1]
    problem, x = found.problem, found.point.x
    assert len(x) > problem.calibration.size
    J = problem.jacobian(found.point, slice(None))
    for k in range(problem.size):
        step = STEP * np.eye(problem.size)[k]
        change = problem.residual(problem.point(x - step)) - problem.residual(problem.point(x + step))
        np.testing.assert_allclose(J[:, :3, k], change[:, :3] / (2.0 * STEP), atol=1e-6 * np.abs(J[:, :3, k]).max())
        # Rotation vectors of residuals r change by I + [r]x / 2 times the rotation: r is below 2e-4 rad here.
        np.testing.assert_allclose(J[:, 3:, k], change[:, 3:] / (2.0 * STEP), atol=2e-4 * np.abs(J[:, 3:, k]).max())
