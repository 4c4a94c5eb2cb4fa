"""A fit whose derivative leaves out small terms, or whose residuals are large and curved, ends at the minimum all the same."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import gtpin
from gtpin.calibration.gauss_newton import MAX_ITERATIONS, FlatValleyError, _by_differences, _cost, fit

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


def best_of(problem: Leaving) -> tuple[np.ndarray, float]:
    """The minimum by SciPy, and its cost."""

    def residuals(x: np.ndarray) -> np.ndarray:
        return np.concatenate([problem.residual(problem.point(x))[:, 0], x])

    best = least_squares(residuals, np.zeros(UNKNOWNS), xtol=1e-12, ftol=1e-14, gtol=1e-12)
    return best.x, float(best.cost)


@pytest.mark.parametrize("seed", range(5))
def test_a_fit_at_the_minimum_is_no_failure_where_the_derivative_leaves_out_small_terms(seed: int) -> None:
    problem = Leaving(seed)
    x, cost = best_of(problem)
    with pytest.raises(gtpin.GtpinError, match="no step lowers its cost"):
        fit(problem, equal, x, left_out=LEFT_OUT)
    found = fit(problem, equal, x, left_out=LEFT_OUT, inexact=1)
    assert _cost(problem, found.point.x, found.residual, found.weight) < cost + LEFT_OUT


@pytest.mark.parametrize("seed", range(5))
def test_the_gradient_by_differences_is_that_of_the_cost(seed: int) -> None:
    problem = Leaving(seed)
    point = problem.point(np.random.default_rng(seed).uniform(-0.1, 0.1, UNKNOWNS))
    residual = problem.residual(point)
    J = np.exp(problem.A @ point.x)[:, None] * problem.A
    exact = J.T @ residual[:, 0] - point.x
    wrong = exact + np.eye(UNKNOWNS)[0] * (problem.wrong @ residual[:, 0])
    assert abs(wrong - exact).max() > 1.0
    found = _by_differences(problem, point, np.ones(ROWS), wrong, 1)
    assert found == pytest.approx(exact, rel=1e-6, abs=1e-4)


def test_steps_by_differences_go_on_where_those_of_the_derivative_end() -> None:
    problem = Leaving(0)
    x, cost = best_of(problem)
    away = x.copy()
    away[0] -= 0.02 * np.sign(
        problem.wrong @ problem.residual(problem.point(x))[:, 0]
    )  # where the derivative leads away
    found = fit(problem, equal, away, left_out=LEFT_OUT, inexact=1)
    before = problem.point(away)
    assert _cost(problem, away, problem.residual(before), np.ones(ROWS)) > cost + LEFT_OUT
    assert _cost(problem, found.point.x, found.residual, found.weight) < cost + LEFT_OUT


class Valley(Leaving):
    """One unknown along which the cost is far flatter than Gauss-Newton expects: the residual 9.99 - x^2 / 20 is large."""

    def __init__(self) -> None:
        self.size, self.prior = 1, np.zeros(1)

    def point(self, x: np.ndarray, near: Any = None) -> Any:
        return SimpleNamespace(x=x, poses=SimpleNamespace(reached=np.ones(2, dtype=bool)))

    def residual(self, point: Any) -> np.ndarray:
        x = float(point.x[0])
        return np.array([[x - 5e-4], [9.99 - x**2 / 20.0]])

    def jacobian(self, point: Any, rows: slice, weight: np.ndarray | None = None) -> np.ndarray:
        return np.array([[[-1.0]], [[point.x[0] / 10.0]]])[rows]


def test_a_fit_along_a_flat_valley_converges() -> None:
    found = fit(Valley(), equal, np.array([-4.0]))
    # The derivative of the cost, x - 5e-4 - (9.99 - x^2 / 20) x / 10, vanishes at the only real root.
    best = min(np.roots([0.005, 0.0, 0.001, -5e-4]), key=lambda root: abs(root.imag))
    assert float(found.point.x[0]) == pytest.approx(float(best.real), abs=0.05)


def test_a_fit_whose_weights_never_settle_ends_where_its_cost_hardly_falls_any_more() -> None:
    problem, calls = Leaving(0), []
    problem.wrong = 0.0 * problem.wrong

    def weigh(residual: np.ndarray) -> np.ndarray:
        calls.append(None)
        return 1.0 + 0.01 * (np.arange(ROWS) % 2 == len(calls) % 2)

    with pytest.raises(FlatValleyError) as crept:
        fit(problem, weigh)
    found = crept.value.fit
    assert found.iterations == MAX_ITERATIONS - 1
    assert np.abs(found.point.x - best_of(problem)[0]).max() < 1e-2
