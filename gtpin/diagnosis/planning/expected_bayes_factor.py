"""How well further measurements would distinguish two hypotheses: expected log Bayes factors of linear Gaussian predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from gtpin.diagnosis.planning.trials import Trials
from gtpin.typing import Floats

Rows = npt.NDArray[np.intp]

IGNORED = 3e-3
"""Mean variance per row, relative to that of the noise, below which a direction is ignored in the choice of rows."""


@dataclass(frozen=True)
class Prediction:
    """The predictive distribution of M further rows with c whitened numbers each, under a hypothesis, given the measured rows.

    Parameters
    ----------
    mean
        (M, c) mean.
    spread
        (M, c, r) root of the covariance without noise: that of rows i and j is spread[i] @ spread[j]'. The noise adds I.
    """

    mean: Floats
    spread: Floats

    @staticmethod
    def of(trials: Trials, columns: Floats) -> Prediction:
        """The prediction for whitened displacements ((N + M) c, m) of standard normal coefficients, and the geometry."""
        c, p = trials.design.components, trials.design.B.shape[1] + columns.shape[1]
        J = np.hstack([trials.design.B, columns])
        old, new = J[trials.old], J[trials.old.stop :]
        factor = cho_factor(np.eye(p) + old.T @ old, lower=True)
        mean = new @ cho_solve(factor, old.T @ trials.design.y[trials.old])
        spread = solve_triangular(factor[0], new.T, lower=True).T
        return Prediction(mean.reshape(-1, c), spread.reshape(len(trials), c, -1))

    def factor(self, rows: Rows, times: int = 1) -> Floats:
        """The lower triangular factor of the covariance of some rows, with noise, each measured ``times`` times and averaged.

        In units of the averages' noise.
        """
        L = np.sqrt(times) * self.spread[rows].reshape(-1, self.spread.shape[2])
        # By QR: where L is very large, I would be lost by rounding in I + L L'.
        upper = np.linalg.qr(np.vstack([L.T, np.eye(len(L))]), mode="r")
        return np.asarray((upper * np.sign(np.diag(upper))[:, None]).T)


@dataclass(frozen=True)
class HypothesisPair:
    """Indices of two hypotheses, of which the first is assumed to be true, and the weight of this pair."""

    true: int
    rival: int
    weight: float


def expected_gain(predictions: Sequence[Prediction], pairs: Sequence[HypothesisPair], rows: Rows) -> float:
    """Expected log Bayes factor, nats, for the true hypothesis by measuring some rows; weighted mean over pairs.

    For a pair (a, b) it is the Kullback-Leibler divergence of N(mu_a, I + L_a L_a') from N(mu_b, I + L_b L_b'), with mu the
    means and L the spreads of the two predictions.
    """
    factors = [p.factor(rows) for p in predictions]
    total = 0.0
    for r in pairs:
        lower = factors[r.true]
        shift = (predictions[r.true].mean - predictions[r.rival].mean)[rows].ravel()
        solved = solve_triangular(factors[r.rival], np.column_stack([lower, shift]), lower=True)
        logs = np.log(np.diag(factors[r.rival])).sum() - np.log(np.diag(lower)).sum()
        total += r.weight * float(0.5 * ((solved**2).sum() - len(shift)) + logs)
    return total / sum(r.weight for r in pairs)


def most_telling(predictions: Sequence[Prediction], pairs: Sequence[HypothesisPair], count: int) -> Rows:
    """(count,) rows that together distinguish the hypotheses best, chosen one by one.

    The criterion is the sum of ln(1 + gain) over the pairs, so that a pair with a large gain already adds little.
    """
    spreads = [_main(p.spread) for p in predictions]
    races = [_Race(predictions[r.true].mean - predictions[r.rival].mean, spreads[r.true]) for r in pairs]
    chosen: list[int] = []
    while len(chosen) < min(count, len(predictions[0].mean)):
        covariances = [np.eye(s.shape[1]) + s @ np.swapaxes(s, 1, 2) for s in spreads]
        inverses: list[Floats] = [np.asarray(np.linalg.inv(S), dtype=float) for S in covariances]
        logs: list[Floats] = [np.asarray(np.linalg.slogdet(S)[1], dtype=float) for S in covariances]
        steps = [
            race.steps(inverses[r.rival], logs[r.rival] - logs[r.true]) for race, r in zip(races, pairs, strict=True)
        ]
        worth = sum(r.weight * np.log1p(race.gain + step) for race, step, r in zip(races, steps, pairs, strict=True))
        worth = np.asarray(worth)
        worth[chosen] = -np.inf
        best = int(worth.argmax())
        chosen.append(best)
        for race, step, r in zip(races, steps, pairs, strict=True):
            race.take(best, spreads[r.rival], inverses[r.rival], float(step[best]))
        spreads = [_known(s, best, S) for s, S in zip(spreads, covariances, strict=True)]
    return np.array(chosen, dtype=np.intp)


def _main(spread: Floats) -> Floats:
    """(M, c, few) approximation of a root of the covariance (M, c, r) by its largest directions."""
    flat = spread.reshape(-1, spread.shape[2])
    values, vectors = np.linalg.eigh(flat.T @ flat)
    return np.asarray(spread @ vectors[:, values > IGNORED * len(spread)])


class _Race:
    """Errors of a rival hypothesis's predictions of all rows where the other one is true; rows are measured one by one."""

    def __init__(self, shift: Floats, spread: Floats) -> None:
        """Take the (M, c) mean and (M, c, r) root of the covariance of the rival's errors before anything is measured."""
        self.shift, self.spread, self.gain = shift.copy(), spread.copy(), 0.0

    def steps(self, inverse: Floats, logs: Floats) -> Floats:
        """(M,) gain by measuring each row next.

        Parameters
        ----------
        inverse, logs
            (M, c, c) inverse of the rival's covariance, and (M,) log of its determinant over that of the true hypothesis.
        """
        c = self.shift.shape[1]
        trace = (inverse * (np.eye(c) + self.spread @ np.swapaxes(self.spread, 1, 2))).sum(axis=(1, 2))
        squared = np.einsum("ni,nij,nj->n", self.shift, inverse, self.shift)
        return np.asarray(0.5 * (trace + squared - c + logs))

    def take(self, row: int, spread: Floats, inverse: Floats, gain: float) -> None:
        """Update the errors after a row is measured; ``spread`` (M, c, r): the rival's root of the covariance before it."""
        update = (spread @ spread[row].T) @ inverse[row]
        self.shift = self.shift - update @ self.shift[row]
        self.spread = np.concatenate([self.spread - update @ self.spread[row], update], axis=2)
        self.gain += gain


def _known(spread: Floats, row: int, covariances: Floats) -> Floats:
    """The root of the covariance after a row was measured (Potter's square-root update for several numbers at a time)."""
    values, vectors = np.linalg.eigh(covariances[row])
    middle = (vectors / (np.sqrt(values) * (np.sqrt(values) + 1.0))) @ vectors.T
    return np.asarray(spread - (spread @ spread[row].T) @ (middle @ spread[row]))
