"""Gauss-Newton with priors, and Levenberg-Marquardt damping if a full step does not lower the cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from gtpin.calibration.problem import Point, Problem
from gtpin.errors import ConvergenceError
from gtpin.kinematics.poses import Poses
from gtpin.model.model import inverse_root
from gtpin.typing import Floats

MAX_ITERATIONS = 500
MAX_DAMPING = 1e12
STEP = 1e-7
"""Step, in units of the tolerances, at which the fit has converged."""
DECREASE = 1e-10
"""Expected decrease of the cost by a step, as a fraction of the cost, at which the fit has converged, by default."""
DIFFERENCE = 1e-4
"""Step of the central differences, in units of the tolerances."""
MOST_BY_DIFFERENCES = 10
"""Most steps with a gradient by differences: each takes as long as two residuals for each unknown. Assumed;
on a real arm the first one gained 0.24 nats, and the next five at most 0.01 each."""
SLOW = 8
"""Number of steps after which a step is made longer while that lowers the cost. Where residuals are large, Gauss-Newton's
curvature J'WJ can be a thousand times that of the cost, as of a free frame and target of a robot that rotates little."""
CREEPING, FLAT = 100, 0.01
"""Number of the last steps, and relative decrease of the cost in these, with which a fit that has not converged in all steps
has found a flat valley: directions that the data do not determine. Assumed: a real arm whose commanded orientation never
changes went from 0.8482 to 0.8454 in root mean square in 500 steps."""
ROUNDING = 1e-6
"""Expected decrease, as a fraction of the cost, at which it has converged if no step lowers the cost: rounding errors."""


@dataclass(frozen=True)
class Fit:
    """A converged fit.

    - ``problem``: the problem that was fitted.
    - ``point``: minimum of the cost.
    - ``residual``: (N, c) whitened measured less predicted.
    - ``weight``: (N,) weights of the poses at the end.
    - ``information``: (size, size) J'WJ of the data alone, with J the whitened derivative and W the weights.
    - ``iterations``: number of steps.
    """

    problem: Problem
    point: Point
    residual: Floats
    weight: Floats
    information: Floats
    iterations: int

    @property
    def covariance(self) -> Floats:
        """(size, size) covariance of x given the data and the prior, for noise of unit weight."""
        root = self.root
        return np.asarray(root @ root.T)

    @cached_property
    def root(self) -> Floats:
        """(size, size) F with F F' the covariance."""
        return inverse_root(self.information + np.diag(self.problem.prior))

    @property
    def factor(self) -> Floats:
        """(size, size) triangular factor of the weighted derivative: it keeps small singular values that J'WJ rounds away."""
        size = self.problem.size
        factor: Floats = np.zeros((0, size))
        for rows in self.problem.chunks():
            J = self.problem.jacobian(self.point, rows, self.weight[rows])
            factor = np.asarray(np.linalg.qr(np.vstack([factor, J.reshape(-1, size)]), mode="r"), dtype=np.float64)
        return factor

    @property
    def effective_parameters(self) -> float:
        """Effective number of parameters: the variance reduction, summed over all directions."""
        return float(len(self.information) - np.diag(self.covariance) @ self.problem.prior)


class FlatValleyError(ConvergenceError):
    """A fit that has not converged, and whose cost hardly falls any more; ``fit`` is its last iterate."""

    def __init__(self, fit: Fit) -> None:
        what = f"the fit has not converged in {MAX_ITERATIONS} steps, and its cost hardly falls any more"
        super().__init__(what, hint=_HINT)
        self.fit = fit


def fit(
    problem: Problem,
    weigh: Callable[[Floats], Floats],
    x: Floats | None = None,
    progress: Callable[[int, float], None] | None = None,
    *,
    near: Poses | None = None,
    decrease: float = DECREASE,
    enough: int = MAX_ITERATIONS,
    left_out: float = 0.0,
    inexact: int = 0,
) -> Fit:
    """Minimise half the weighted sum of squares of the whitened residuals, plus half the sum of prior x^2.

    - ``weigh``: weights (N,) of the poses from whitened residuals (N, c): iteratively reweighted least squares.
    - ``x``: start of the iterations; nominal (zeros) by default.
    - ``progress``: called with the iteration and the root mean square of the weighted residuals.
    - ``near``: first guess of the poses, base frame.
    - ``decrease``: the fit has converged when a step is expected to decrease the cost by less than this fraction of it.
    - ``enough``: number of steps after which the fit stops without an error, converged or not.
    - ``left_out``: for a derivative that leaves out small terms: expected decrease of the cost by the undamped step with
      which the fit still counts as converged, where no step lowers the cost; a tenth of it with a gradient by differences.
    - ``inexact``: number of the first unknowns whose derivative leaves out small terms. Where no step lowers the cost and
      more than ``left_out`` is expected, the gradient by them is computed by central differences from there on.

    Raises `ConvergenceError` if no minimum is found within `MAX_ITERATIONS` steps; `FlatValleyError`, where its cost hardly
    falls by then.
    """
    point = problem.point(np.zeros(problem.size) if x is None else x, near)
    if lost := np.count_nonzero(~point.poses.reached):
        what = f"{lost} poses can't be reached by the geometry that the fit starts from"
        raise ConvergenceError(what, hint="leave them out")
    residual = problem.residual(point)
    damping, exact_steps, costs = 0.0, 0, []
    for iteration in range(MAX_ITERATIONS):
        weight = weigh(residual)
        information, gradient = _normal_equations(problem, point, residual, weight)
        gradient = gradient - problem.prior * point.x
        if exact_steps:
            gradient = _by_differences(problem, point, weight, gradient, inexact)
            exact_steps += 1
        cost = _cost(problem, point.x, residual, weight)
        if progress is not None:
            progress(iteration, float(np.sqrt((weight[:, None] * residual**2).mean())))
        costs.append(cost)
        creeps = len(costs) >= CREEPING and costs[-CREEPING] <= (1.0 + FLAT) * cost
        if iteration >= enough:
            return Fit(problem, point, residual, weight, information, iteration)
        if creeps and iteration == MAX_ITERATIONS - 1:
            raise FlatValleyError(Fit(problem, point, residual, weight, information, iteration))
        A, negligible = information + np.diag(problem.prior), max(ROUNDING * max(cost, 1.0), left_out)
        while True:
            step = _step(A, gradient, damping)
            promised = float(step @ gradient) / 2.0
            if exact_steps > MOST_BY_DIFFERENCES:
                if promised <= left_out:
                    return Fit(problem, point, residual, weight, information, iteration)
                raise ConvergenceError("the fit has not converged by steps with a gradient by differences", hint=_HINT)
            least = max(decrease * max(cost, 1.0), left_out / 10.0 if exact_steps else 0.0)
            # A damped step is small at any place; the undamped one says whether more than rounding errors is left to gain.
            small = np.abs(step).max() <= STEP or promised <= least
            if small and (damping == 0.0 or _gain(A, gradient) <= negligible):
                return Fit(problem, point, residual, weight, information, iteration)
            trial = problem.point(point.x + step, point.poses)
            if trial.poses.reached.all():
                trial_residual = problem.residual(trial)
                if _cost(problem, trial.x, trial_residual, weight) < cost:
                    if iteration >= SLOW:
                        trial, trial_residual = _farther(problem, point, trial, trial_residual, weight)
                    point, residual = trial, trial_residual
                    damping = damping / 10.0 if damping > 1e-6 else 0.0
                    break
            if damping > MAX_DAMPING:
                if _gain(A, gradient) <= negligible:
                    return Fit(problem, point, residual, weight, information, iteration)
                if inexact and not exact_steps:
                    gradient = _by_differences(problem, point, weight, gradient, inexact)
                    damping, exact_steps = 0.0, 1
                    continue
                raise ConvergenceError("the fit has not converged: no step lowers its cost", hint=_HINT)
            damping = max(10.0 * damping, 1e-3)
    raise ConvergenceError(f"the fit has not converged in {MAX_ITERATIONS} steps", hint=_HINT)


def _farther(problem: Problem, start: Point, best: Point, residual: Floats, weight: Floats) -> tuple[Point, Floats]:
    """The point with the lowest cost, and its residual, of those at 1, 2, 4, ... times the way from ``start`` to ``best``."""
    way, cost = best.x - start.x, _cost(problem, best.x, residual, weight)
    while True:
        way = 2.0 * way
        point = problem.point(start.x + way, best.poses)
        if not point.poses.reached.all():
            return best, residual
        there = problem.residual(point)
        lower = _cost(problem, point.x, there, weight)
        if not lower < cost:
            return best, residual
        best, residual, cost = point, there, lower


def _gain(A: Floats, gradient: Floats) -> float:
    """Expected decrease of the cost by the undamped step."""
    return float(_step(A, gradient, 0.0) @ gradient) / 2.0


def _by_differences(problem: Problem, point: Point, weight: Floats, gradient: Floats, count: int) -> Floats:
    """The gradient (size,) with its first ``count`` components by central differences of the cost."""
    found = gradient.copy()
    for i in range(count):
        ways = []
        for step in (DIFFERENCE, -DIFFERENCE):
            x = point.x.copy()
            x[i] += step
            there = problem.point(x, point.poses)
            reached = there.poses.reached.all()
            ways.append(_cost(problem, x, problem.residual(there), weight) if reached else np.nan)
        if np.isfinite(ways).all():
            found[i] = (ways[1] - ways[0]) / (2.0 * DIFFERENCE)
    return found


_HINT = (
    "check units, the order of columns and the tolerances, whether the poses are the robot's, where the target sits, "
    "and whether the instrument "
    'stood elsewhere (frame = "free")'
)


def _normal_equations(problem: Problem, point: Point, residual: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """J'WJ (size, size) and J'Wr (size,) of the data alone, J the derivative of the whitened prediction by x."""
    information, gradient = np.zeros((problem.size, problem.size)), np.zeros(problem.size)
    for rows in problem.chunks():
        flat = problem.jacobian(point, rows, weight[rows]).reshape(-1, problem.size)
        information += flat.T @ flat
        gradient += flat.T @ (residual[rows] * np.sqrt(weight[rows])[:, None]).ravel()
    return information, gradient


def _cost(problem: Problem, x: Floats, residual: Floats, weight: Floats) -> float:
    return float((weight[:, None] * residual**2).sum() + (problem.prior * x**2).sum()) / 2.0


def _step(curvature: Floats, gradient: Floats, damping: float) -> Floats:
    damped = curvature + damping * np.diag(np.diag(curvature))
    if not (np.isfinite(damped).all() and np.isfinite(gradient).all()):
        raise ConvergenceError("the fit ran into a singularity of the robot", hint=_HINT)
    try:
        return np.asarray(cho_solve(cho_factor(damped), gradient))
    except LinAlgError:
        hint = f"measure more poses, leave parameters out, or {_HINT}"
        raise ConvergenceError("the fit has no unique minimum", hint=hint) from None
