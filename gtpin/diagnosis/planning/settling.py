"""How probable it is that further measurements settle which of several hypotheses is the cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from gtpin.diagnosis.planning.expected_bayes_factor import Prediction, Rows
from gtpin.diagnosis.priors import SURE
from gtpin.typing import Floats

DRAWN = 400
"""Number of simulated measurements. The standard error of a probability is 2.5 % at most."""
PROMISED = 0.8
"""Probability of settling the question from which one experiment is said to be enough."""
MOST_ROUNDS = 10
"""Most rounds of the same measurements that are considered."""


@dataclass(frozen=True)
class Rivals:
    """The hypotheses of a class, and the smooth terms in their place, with their predictions and probabilities.

    Parameters
    ----------
    named, probabilities
        Predictions of two or more hypotheses, and how probable each is now.
    smooth, smooth_probabilities
        The same for smooth terms. Only the most probable of them counts, as in the diagnosis.
    heat
        The temperature of the diagnosis.
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
