"""The evidence above which a check raises an alarm, from simulated checks of a machine that has not changed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.linear.evidence import gains_of_draws
from gtpin.distributions import chi2
from gtpin.typing import Floats

NUMBERS = 4_000_000
"""Number of simulated residuals that are in memory at the same time."""


@dataclass(frozen=True)
class Axes:
    """A hypothesis, and the axes along which its coefficients are independent.

    Parameters
    ----------
    hypothesis
        The hypothesis.
    values, vectors
        (c,) eigenvalues and (c, c) eigenvectors of its c columns' inner products, with the earlier model marginalised.
    core
        Indices of the columns that are the core; empty where all are.
    weights
        (N c, c) the numbers by which a residual is multiplied for its inner products along the axes.
    """

    hypothesis: Hypothesis
    values: Floats
    vectors: Floats
    core: tuple[int, ...]
    weights: Floats


class Bench:
    """Gains in log evidence, nats, of every hypothesis alone, for many drawn residuals at once."""

    def __init__(self, hypotheses: HypothesisSet, unexplained: float = 0.0) -> None:
        """Take the hypotheses of a check, and the share of the earlier model's unexplained errors in the variance."""
        self.hypotheses, groups = hypotheses, hypotheses.groups
        self.share = unexplained
        self.axes = []
        for hypothesis in hypotheses.linear:
            values, vectors = np.linalg.eigh(groups.block(hypothesis, hypothesis))
            weights = groups.marginal.past(groups.columns(hypothesis)) @ vectors
            self.axes.append(Axes(hypothesis, np.maximum(values, 0.0), vectors, groups.core[hypothesis], weights))

    def unchanged(self, draws: int, rng: np.random.Generator) -> Floats:
        """(N c, draws) whitened residuals of a machine that has not changed: noise, and the error of the earlier model.

        That error is the one of the model's unknowns, and what the model left unexplained of its own data. The latter could
        be anything; what is taken for a change most easily is an effect that can be named as a change, and was there before.
        So in each draw it is one of these effects, with random coefficients.

        The pose of a free instrument is left out: no gain depends on it.
        """
        design = self.hypotheses.design
        noise = rng.standard_normal((len(design.y), draws))
        B = design.B[:, : design.n_prior]
        y = noise * np.sqrt(1.0 - self.share) + B @ rng.standard_normal((B.shape[1], draws))
        if self.share == 0.0 or not self.axes:
            return np.asarray(y)
        which = rng.integers(0, len(self.axes), draws)
        for i, axes in enumerate(self.axes):
            own = np.flatnonzero(which == i)
            X = self.hypotheses.groups.columns(axes.hypothesis)
            power = (X**2).sum(axis=1).reshape(len(design.whitening), -1).mean(axis=1)
            # An effect that acts at a few poses is not larger there for it: the mean is over the poses at which it acts.
            size = np.sqrt(self.share * power.sum() / max(float((power**2).sum()), 1e-300))
            drawn = rng.standard_normal((X.shape[1], len(own)))
            y[:, own] += size * (X @ (drawn * np.sqrt(X.shape[1] / (drawn**2).sum(axis=0))))
        return np.asarray(y)

    def moments(self, axes: Axes, y: Floats) -> Floats:
        """(draws, c) inner products of a hypothesis, along its axes, with residuals y (N c, draws)."""
        return y.T @ axes.weights

    def gains(self, axes: Axes, moments: Floats) -> Floats:
        """(draws,) gains of a hypothesis, for moments (draws, c) along its axes."""
        return gains_of_draws(axes.values, axes.vectors, moments, axes.core, self.hypotheses.priors)

    def largest(self, y: Floats) -> Floats:
        """(draws,) largest gain of any hypothesis, for residuals y (N c, draws)."""
        best = np.full(y.shape[1], -np.inf)
        for axes in self.axes:
            best = np.maximum(best, self.gains(axes, self.moments(axes, y)))
        return best


def chance(bench: Bench, power: float, draws: int, rng: np.random.Generator) -> float:
    """Probability that chi-square of an unchanged machine's residuals, the earlier model marginalised, exceeds ``power``.

    It is found from ``draws`` simulated checks where there are unexplained errors: these are not independent.
    """
    if bench.share == 0.0:
        return float(chi2.sf(power, bench.hypotheses.design.dof))
    above, marginal = 0, bench.hypotheses.groups.marginal
    for y in _batches(bench, draws, rng):
        above += int(((y**2).sum(axis=0) - (marginal.half(y) ** 2).sum(axis=0) >= power).sum())
    return above / draws


def threshold(bench: Bench, false_alarm: float, draws: int, rng: np.random.Generator) -> float:
    """The gain in log evidence, nats, that the best of all hypotheses exceeds by chance with the probability ``false_alarm``.

    ``draws``: number of simulated checks of an unchanged machine.
    """
    if not bench.axes:
        return np.inf
    found = np.concatenate([bench.largest(y) for y in _batches(bench, draws, rng)])
    return float(np.quantile(found, 1.0 - false_alarm, method="higher"))


def _batches(bench: Bench, draws: int, rng: np.random.Generator) -> Iterator[Floats]:
    """The residuals of ``draws`` simulated checks of an unchanged machine, as many at a time as fit in memory."""
    most = max(NUMBERS // len(bench.hypotheses.design.y), 1)
    for start in range(0, draws, most):
        yield bench.unchanged(min(most, draws - start), rng)
