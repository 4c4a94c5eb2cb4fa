"""How well further measurements would distinguish hypotheses: expected log Bayes factors, and the probability of settling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.special import logsumexp

from gtpin.diagnosis.planning.trials import Trials
from gtpin.diagnosis.priors import SURE
from gtpin.typing import Floats

Rows = npt.NDArray[np.intp]

IGNORED = 3e-3
"""Mean variance per row, relative to that of the noise, below which a direction is ignored in the choice of rows."""


@dataclass(frozen=True)
class Prediction:
    """The predictive distribution of M further rows with c whitened numbers each, under a hypothesis, given the measured rows.

    ``mean``: (M, c) mean. ``spread``: (M, c, r) root of the covariance without noise: that of rows i and j is spread[i] @
    spread[j]'. The noise adds I.
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

        ``inverse``, ``logs``: (M, c, c) inverse of the rival's covariance, and (M,) log of its determinant over that of the
        true hypothesis.
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


DRAWN = 400
"""Number of simulated measurements. The standard error of a probability is 2.5 % at most."""
PROMISED = 0.8
"""Probability of settling the question from which one experiment is said to be enough."""
MOST_ROUNDS = 10
"""Most rounds of the same measurements that are considered."""


@dataclass(frozen=True)
class Rivals:
    """The hypotheses of a class, and the smooth terms in their place, with their predictions and probabilities.

    ``named``, ``probabilities``: predictions of two or more hypotheses, and how probable each is now. ``smooth``,
    ``smooth_probabilities``: the same for smooth terms. Only the most probable of them counts, as in the diagnosis. ``heat``:
    the temperature of the diagnosis.
    """

    named: Sequence[Prediction]
    probabilities: Sequence[float]
    smooth: Sequence[Prediction]
    smooth_probabilities: Sequence[float]
    heat: float


def settling_probability(rivals: Rivals, rows: Rows, rng: np.random.Generator, rounds: int = 1) -> float:
    """Probability that one hypothesis has a probability of 0.95 or more after some rows are measured, each ``rounds`` times.

    Measurements are simulated from each hypothesis as often as it is probable. Log Bayes factors are divided by the
    temperature, as in the diagnosis. What is not listed has the rest of the probability. It is assumed to gain as much as the
    strongest alternative of the leader.
    """
    n, share = len(rivals.named), np.array([*rivals.probabilities, *rivals.smooth_probabilities])
    rest = max(1.0 - share[:n].sum() - share[n:].max(initial=0.0), 0.0)
    predictions = [*rivals.named, *rivals.smooth]
    means = [np.sqrt(rounds) * p.mean[rows].ravel() for p in predictions]
    factors = [p.factor(rows, rounds) for p in predictions]
    true = rng.choice(n, DRAWN, p=share[:n] / share[:n].sum())
    noise = rng.standard_normal((DRAWN, len(means[0])))
    measured = np.stack([means[t] + factors[t] @ z for t, z in zip(true, noise, strict=True)], axis=1)
    gain = np.stack([_log_density(measured, *p) for p in zip(means, factors, strict=True)]) / rivals.heat
    with np.errstate(divide="ignore"):
        after = np.log(share)[:, None] + gain
        named, smooth = after[:n], after[n:].max(axis=0, initial=-np.inf)
        leader = named.max(axis=0)
        others = np.where(named == leader, -np.inf, gain[:n]).max(axis=0)
        whole = logsumexp(np.vstack([named, smooth, np.log(rest) + others]), axis=0)
    return float(np.mean(np.exp(leader - whole) >= SURE))


def rounds_needed(rivals: Rivals, rows: Rows, rng: np.random.Generator) -> tuple[float, int | None]:
    """The probability that one round settles the question, and the number of rounds that are enough.

    None: more than ten rounds.
    """
    # A stream of its own, so that other plans do not depend on whether this is computed. The random numbers are the same for
    # each number of rounds, so that more rounds are not worse by chance.
    seed, found = int(rng.spawn(1)[0].integers(2**31)), list[float]()
    for rounds in range(1, MOST_ROUNDS + 1):
        found.append(settling_probability(rivals, rows, np.random.default_rng(seed), rounds))
        if found[-1] >= PROMISED:
            return found[0], rounds
    return found[0], None


def _log_density(measured: Floats, mean: Floats, factor: Floats) -> Floats:
    """(D,) log density of (m, D) numbers under N(mean, factor @ factor'), less a constant."""
    solved = solve_triangular(factor, measured - mean[:, None], lower=True)
    return np.asarray(-0.5 * (solved**2).sum(axis=0) - np.log(np.diag(factor)).sum())
