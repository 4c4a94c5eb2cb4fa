"""Calibration, and a Gaussian process over commands and covariates for what it leaves: predicts, and names no cause.

For a tracker's positions. For readings of other instruments it predicts as the geometry alone does.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from problem import Problem, predictions
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from gtpin.bench.benchmark.answer import Answer
from gtpin.data import Commands, Dataset
from gtpin.model.model import Model
from gtpin.typing import Floats

START = np.log([2.0, 0.7, 1.0, 0.7])
"""Start of the search, logarithms: amplitude and length scale over the commands, amplitude over the covariates, and noise,
in units of the residuals' standard deviation and the commands' spread."""
TRIALS = 60
ROWS = 400
"""Largest number of rows that are used."""


def answer(folder: Path) -> Answer:
    """The answer to one case."""
    problem = Problem.of(folder)
    plain = predictions(problem.baseline, folder)
    dataset = problem.prepared.dataset
    if plain.readings or dataset.instrument.frame == "free":
        return plain
    used = dataset.take(problem.prepared.baseline.used(dataset))
    commands = Commands.read(folder / "commands.csv", dataset.n_actuators)
    return Answer(positions=gaussian_process_positions(used, problem.baseline, commands).tolist())


def gaussian_process_positions(dataset: Dataset, baseline: Model, commands: Commands) -> Floats:
    """(H, 3) positions at commands, m: those of the baseline plus a Gaussian process fitted to its residuals at the dataset's
    rows.

    Squared-exponential kernels over the commands together and over each covariate alone (its length scale
    is the covariate's spread); the other hyperparameters by maximum a posteriori (Rasmussen and Williams 2006, ch. 5).
    """
    rows = np.linspace(0, len(dataset) - 1, min(len(dataset), ROWS)).astype(int)
    residual = dataset.position[rows] - baseline.predict(dataset.q[rows]).T
    size = max(float(residual.std()), 1e-12)
    y = (residual - residual.mean(axis=0)) / size
    own, wanted = _covariates(dataset.commands, commands)[rows], _covariates(commands, dataset.commands)
    near = _near(dataset.q[rows], own, dataset.q[rows], own)

    def factor(log: Floats) -> tuple[Floats, bool]:
        return cho_factor(_kernel(near, log) + (np.exp(2.0 * log[3]) + 1e-8) * np.eye(len(y)), lower=True)

    def cost(log: Floats) -> float:
        try:
            lower = factor(log)
        except np.linalg.LinAlgError:
            return 1e12
        fit = 0.5 * float((y * cho_solve(lower, y)).sum()) + 3.0 * float(np.log(np.diag(lower[0])).sum())
        return fit + float(((log - START) ** 2).sum()) / 8.0

    best = minimize(cost, START, method="Nelder-Mead", options={"maxfev": TRIALS}).x
    across = _kernel(_near(dataset.q[rows], own, commands.q, wanted), best)
    correction = across.T @ cho_solve(factor(best), y) * size + residual.mean(axis=0)
    return np.asarray(baseline.predict(commands.q).T + correction)


def _covariates(own: Commands, other: Commands) -> Floats:
    """(N, c) numeric covariates that both have."""
    both = [n for n in own.covariates if n in other.covariates and own.covariates[n].dtype == np.float64]
    return np.column_stack([np.zeros((len(own), 0)), *(own.covariates[n] for n in both)])


def _near(q: Floats, covariates: Floats, other_q: Floats, other: Floats) -> tuple[Floats, Floats]:
    """(N, H) squared distances over the commands, and the mean kernel of the covariates, in units of their spreads."""
    spread, spreads = max(float(q.std(axis=0).mean()), 1e-12), covariates.std(axis=0)
    over_q = (((q[:, None] - other_q) / spread) ** 2).sum(axis=2)
    vary = spreads > 1e-9
    if not vary.any():
        return over_q, np.zeros(over_q.shape)
    squares = ((covariates[:, None, vary] - other[:, vary]) / spreads[vary]) ** 2
    return over_q, np.exp(-0.5 * squares).mean(axis=2)


def _kernel(near: tuple[Floats, Floats], log: Floats) -> Floats:
    over_q, together = near
    return np.asarray(np.exp(2.0 * log[0] - 0.5 * over_q * np.exp(-2.0 * log[1])) + np.exp(2.0 * log[2]) * together)
