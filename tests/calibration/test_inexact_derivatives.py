"""A fit whose derivative leaves out small terms ends at the minimum all the same."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import gtpin
from gtpin.calibration.gauss_newton import fit

ROWS, UNKNOWNS = 4000, 5
LEFT_OUT = 0.1


class Leaving:
    """y = exp(A x) + noise, with a derivative by the first unknown to which a small part of the errors is added."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.A = rng.standard_normal((ROWS, UNKNOWNS))
        self.size, self.prior = UNKNOWNS, np.ones(UNKNOWNS)
        self.y = np.exp(self.A @ (0.1 * rng.standard_normal(UNKNOWNS))) + rng.standard_normal(ROWS)
        self.wrong = 3e-2 * (self.y - 1.0)

    def point(self, x: np.ndarray, near: Any = None) -> Any:
        return SimpleNamespace(x=x, poses=SimpleNamespace(reached=np.ones(ROWS, dtype=bool)))

    def residual(self, point: Any) -> np.ndarray:
        return (self.y - np.exp(self.A @ point.x))[:, None]

    def jacobian(self, point: Any, rows: slice, weight: np.ndarray | None = None) -> np.ndarray:
        J = np.exp(self.A @ point.x)[:, None] * self.A
        J[:, 0] += self.wrong
        return J[rows, None, :]

    def chunks(self) -> list[slice]:
        return [slice(None)]


def equal(residual: np.ndarray) -> np.ndarray:
    return np.ones(len(residual))


@pytest.mark.parametrize("seed", range(5))
def test_a_fit_at_the_minimum_ends_by_differences_where_the_derivative_leaves_out_small_terms(seed: int) -> None:
    problem = Leaving(seed)

    def residuals(x: np.ndarray) -> np.ndarray:
        return np.concatenate([problem.residual(problem.point(x))[:, 0], x])

    best = least_squares(residuals, np.zeros(UNKNOWNS), xtol=1e-12, ftol=1e-14, gtol=1e-12)
    with pytest.raises(gtpin.GtpinError, match="no step lowers its cost"):
        fit(problem, equal, best.x, left_out=LEFT_OUT)
    found = fit(problem, equal, best.x, left_out=LEFT_OUT, inexact=1)
    assert 0.5 * (residuals(found.point.x) ** 2).sum() < best.cost + LEFT_OUT
