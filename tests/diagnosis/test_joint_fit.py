"""A joint fit's derivative and minimum, by differences of the exact prediction."""

from typing import Any

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.diagnosis.inference import joint_fit

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")]

ARM = [("rack_periodic", "elbow_joint"), ("linearity", "shoulder_lift_joint")]
ENERGY = 2e5
"""Deviations of some mrad, which change the derivative itself by more than the bound below."""


@pytest.fixture
def fits(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Joint fits as diagnoses make them."""
    made, fit = [], joint_fit.fit

    def recorded(*arguments: Any, **options: Any) -> Any:
        made.append(fit(*arguments, **options))
        return made[-1]

    monkeypatch.setattr(joint_fit, "fit", recorded)
    return made


def differences(found: Any, step: float) -> np.ndarray:
    """(N, c, p) derivative of the prediction by the numbers of a fit, in sigmas of the priors."""
    problem, x = found.problem, found.point.x
    steps = step * np.eye(problem.size)
    change = [problem.residual(problem.point(x - s)) - problem.residual(problem.point(x + s)) for s in steps]
    return np.stack(change, axis=2) / (2.0 * step)


def test_the_derivative_of_an_arms_joint_fit_is_that_of_finite_differences(fits: list[Any]) -> None:
    gtpin.diagnose(make_case(31, effects=ARM, energy=ENERGY, poses=80, robot="ur5").dataset)
    found = fits[-1]
    assert len(found.point.x) > found.problem.calibration.size
    J, exact = found.problem.jacobian(found.point, slice(None)), differences(found, 1e-3)
    size = np.abs(J).max(axis=0)
    assert (np.abs(J - exact)[:, :3] <= 1e-6 * size[:3].max(axis=0)).all()
    # Rotation vectors of residuals r change by I + [r]x / 2 times the rotation: r is below 2e-4 rad here.
    assert (np.abs(J - exact)[:, 3:] <= 2e-4 * size[3:].max(axis=0)).all()


@pytest.mark.parametrize(
    ("seed", "effect"), [(6, "link_compliance"), (3, "link_compliance"), (7, "cart_compliance"), (1, "joint_clearance")]
)
def test_no_step_of_the_exact_derivative_lowers_the_cost_of_a_joint_fit(
    seed: int, effect: str, fits: list[Any]
) -> None:
    gtpin.diagnose(make_case(seed, effects=[(effect, None)], energy=1500.0, poses=120).dataset)
    assert fits
    for found in fits:
        J, weight, prior = differences(found, 1e-4), found.weight, found.problem.prior
        gradient = np.einsum("ncp,nc,n->p", J, found.residual, weight) - prior * found.point.x
        curvature = np.einsum("ncp,ncr,n->pr", J, J, weight) + np.diag(prior)
        assert gradient @ np.linalg.solve(curvature, gradient) / 2.0 < 0.01  # nats, by a Gauss-Newton step
