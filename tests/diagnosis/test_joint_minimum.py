"""A joint fit that stops where no step lowers its cost is at the minimum: checked by derivatives of the exact prediction."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from diagnosed import machine

import gtpin
from gtpin.diagnosis.inference import joint_fit

pytestmark = pytest.mark.slow

STEP = 1e-4
"""In sigmas of the priors."""


def exact_promise(found: Any) -> float:
    """Decrease of the cost, nats, by a Gauss-Newton step whose derivative is of finite differences of the prediction."""
    problem, x, residual, weight = found.problem, found.point.x, found.residual, found.weight
    steps = STEP * np.eye(problem.size)
    change = [problem.residual(problem.point(x + s)) - problem.residual(problem.point(x - s)) for s in steps]
    J = -np.stack(change, axis=2) / (2.0 * STEP)
    gradient = np.einsum("ncp,nc,n->p", J, residual, weight) - problem.prior * x
    curvature = np.einsum("ncp,ncr,n->pr", J, J, weight) + np.diag(problem.prior)
    return float(gradient @ np.linalg.solve(curvature, gradient)) / 2.0


@pytest.mark.parametrize(
    ("seed", "effect"), [(6, "link_compliance"), (3, "link_compliance"), (7, "cart_compliance"), (1, "joint_clearance")]
)
def test_no_step_of_the_exact_derivative_lowers_the_cost_of_a_joint_fit(seed, effect, monkeypatch):
    fits = []

    def recorded(*arguments: Any, **options: Any) -> Any:
        fits.append(fit(*arguments, **options))
        return fits[-1]

    fit = joint_fit.fit
    monkeypatch.setattr(joint_fit, "fit", recorded)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of poses that a large fault makes look like gross errors
        gtpin.diagnose(machine(seed, effect).dataset)
    assert fits
    assert max(exact_promise(found) for found in fits) < 0.01
