"""The evidence above which a check raises an alarm, from simulated checks of a machine that has not changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import gains_of_draws

Floats = npt.NDArray[np.float64]


def unchanged(design: Design, draws: int, rng: np.random.Generator) -> Floats:
    """(N c, draws) whitened residuals of a machine that has not changed: noise, and the error of the earlier model.

    The pose of a free instrument is left out: no gain depends on it.
    """
    noise = rng.standard_normal((len(design.y), draws))
    B = design.B[:, : design.n_prior]
    return np.asarray(noise + B @ rng.standard_normal((B.shape[1], draws)))


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

    def __init__(self, hypotheses: HypothesisSet) -> None:
        """Take the hypotheses of a check."""
        self.hypotheses, groups = hypotheses, hypotheses.groups
        self.axes = []
        for hypothesis in hypotheses.linear:
            values, vectors = np.linalg.eigh(groups.block(hypothesis, hypothesis))
            weights = groups.marginal.past(groups.columns(hypothesis)) @ vectors
            self.axes.append(Axes(hypothesis, np.maximum(values, 0.0), vectors, groups.core[hypothesis], weights))

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


def threshold(bench: Bench, false_alarm: float, draws: int, rng: np.random.Generator) -> float:
    """The gain in log evidence, nats, that the best of all hypotheses exceeds by chance with the probability ``false_alarm``.

    ``draws``: number of simulated checks of an unchanged machine.
    """
    if not bench.axes:
        return np.inf
    found = bench.largest(unchanged(bench.hypotheses.design, draws, rng))
    return float(np.quantile(found, 1.0 - false_alarm, method="higher"))
