"""The evidence above which a check raises an alarm, and the smallest changes that it finds: both from simulated checks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gtpin.diagnosis.evidence import gains_of_draws
from gtpin.diagnosis.findings import Smallest
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.distributions import chi2
from gtpin.typing import Floats

NUMBERS = 4_000_000
"""Number of simulated residuals that are in memory at the same time."""
DRAWS, POWER_DRAWS = 10_000, 800
"""Numbers of draws: for the alarm's threshold, with which a probability of 1 % has a standard error of 0.1 %; and for each
smallest change, with which 95 % have a standard error of 0.8 %."""
LARGEST = 1e3
"""Size of a change, over its typical size, at which the search for the smallest one ends. Assumed."""
STEPS = 12
"""Number of bisections of the logarithm of the size, from 1e-3 to `LARGEST`: they determine the size to 0.4 %."""
NAMED = 60
"""Number of random shapes for the median of a parameter."""


@dataclass(frozen=True)
class Axes:
    """A hypothesis, and the axes along which its coefficients are independent.

    ``values``, ``vectors``: eigenvalues (c,) and eigenvectors of its c columns' inner products, with the earlier model
    marginalised. ``core``: indices of the core's columns; empty where all are. ``weights``: (N c, c) by which a residual is
    multiplied for its inner products along the axes.
    """

    hypothesis: Hypothesis
    values: Floats
    vectors: Floats
    core: tuple[int, ...]
    weights: Floats


class GainSampler:
    """Gains in log evidence, nats, of every hypothesis of a check alone, for residuals of simulated checks.

    ``unexplained``: share of the earlier model's unexplained errors in the variance of the whitened residuals.
    """

    def __init__(self, hypotheses: HypothesisSet, unexplained: float = 0.0) -> None:
        self.hypotheses, self.share = hypotheses, unexplained
        groups, self.axes = hypotheses.groups, list[Axes]()
        for hypothesis in hypotheses.linear:
            values, vectors = np.linalg.eigh(groups.block(hypothesis, hypothesis))
            weights = groups.marginal.past(groups.columns(hypothesis)) @ vectors
            self.axes.append(Axes(hypothesis, np.maximum(values, 0.0), vectors, groups.core[hypothesis], weights))

    def unchanged(self, draws: int, rng: np.random.Generator) -> Floats:
        """(N c, draws) whitened residuals of a machine that has not changed: noise, and the error of the earlier model.

        That error is the one of the model's unknowns, and what the model left unexplained of its own data. The latter could
        be anything; most easily taken for a change is an effect that can be named as one, and was there before: in each draw it
        is one of these, with random coefficients. The pose of a free instrument is left out: no gain depends on it.
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

    def gains(self, axes: Axes, moments: Floats) -> Floats:
        """(draws,) gains of a hypothesis, for its inner products (draws, c) with residuals, along its axes."""
        return gains_of_draws(axes.values, axes.vectors, moments, axes.core, self.hypotheses.priors)

    def largest(self, y: Floats) -> Floats:
        """(draws,) largest gain of any hypothesis, for residuals y (N c, draws)."""
        best = np.full(y.shape[1], -np.inf)
        for axes in self.axes:
            best = np.maximum(best, self.gains(axes, y.T @ axes.weights))
        return best

    def batches(self, draws: int, rng: np.random.Generator) -> Iterator[Floats]:
        """The residuals of ``draws`` simulated checks of an unchanged machine, as many at a time as fit in memory."""
        most = max(NUMBERS // len(self.hypotheses.design.y), 1)
        for start in range(0, draws, most):
            yield self.unchanged(min(most, draws - start), rng)


def threshold(sampler: GainSampler, false_alarm: float, draws: int, rng: np.random.Generator) -> float:
    """The gain in log evidence, nats, that the best hypothesis exceeds by chance with the probability ``false_alarm``."""
    if not sampler.axes:
        return np.inf
    found = np.concatenate([sampler.largest(y) for y in sampler.batches(draws, rng)])
    return float(np.quantile(found, 1.0 - false_alarm, method="higher"))


def chance(sampler: GainSampler, power: float, draws: int, rng: np.random.Generator) -> float:
    """Probability that chi-square of an unchanged machine's residuals, the earlier model marginalised, exceeds ``power``.

    It is found from ``draws`` simulated checks where there are unexplained errors: these are not independent.
    """
    if sampler.share == 0.0:
        return float(chi2.sf(power, sampler.hypotheses.design.dof))
    above, marginal = 0, sampler.hypotheses.groups.marginal
    for y in sampler.batches(draws, rng):
        above += int(((y**2).sum(axis=0) - (marginal.half(y) ** 2).sum(axis=0) >= power).sum())
    return above / draws


def smallest_changes(
    sampler: GainSampler, threshold: float, power: float, rng: np.random.Generator
) -> tuple[Smallest, ...]:
    """For each hypothesis, the smallest change whose own gain in log evidence exceeds ``threshold`` with probability ``power``.

    The probability of an alarm is at least this: another hypothesis, or chi-square, may raise the alarm too.
    """
    at, found = sampler.hypotheses.design.operating_points, list[Smallest]()
    y = sampler.unchanged(POWER_DRAWS, rng)
    for axes in sampler.axes:
        hypothesis, shape = axes.hypothesis, _shapes(axes, POWER_DRAWS, rng)
        null, along = y.T @ axes.weights, (shape @ axes.vectors) * axes.values

        def seen(size: float, axes: Axes = axes, null: Floats = null, along: Floats = along) -> bool:
            """Whether enough of the drawn changes, multiplied by ``size``, exceed the threshold."""
            return float((sampler.gains(axes, null + size * along) >= threshold).mean()) >= power

        low, high = np.log(1e-3), np.log(LARGEST)
        for _ in range(STEPS if (ever := seen(LARGEST)) else 0):
            middle = (low + high) / 2.0
            low, high = (low, middle) if seen(float(np.exp(middle))) else (middle, high)
        sigma = hypothesis.basis(at).sigma
        named = [hypothesis.effect.parameters_of(at.robot, hypothesis.site, u * sigma, ()) for u in shape[:NAMED]]
        name, (_, unit) = next(iter(named[0].items()))
        typical = float(np.median([abs(one[name][0]) for one in named]))
        found.append(Smallest(*hypothesis.place, name, float(np.exp(high)) * typical if ever else None, unit))
    return tuple(found)


def _shapes(axes: Axes, draws: int, rng: np.random.Generator) -> Floats:
    """(draws, c) coefficients of random changes of typical size: of the core where there is one, none in the modulation."""
    c = len(axes.values)
    own = list(axes.core) or list(range(c))
    drawn = rng.standard_normal((draws, len(own)))
    found = np.zeros((draws, c))
    found[:, own] = drawn * np.sqrt(len(own) / (drawn**2).sum(axis=1, keepdims=True))
    return found
