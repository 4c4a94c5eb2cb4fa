"""Many machines calibrated, and what a correct estimator's errors can be."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom, chi2
from virtual_gantry import Machine

import gtpin

Floats = np.ndarray
Case = tuple[Machine, gtpin.Dataset]

ONCE = 1e-4
"""Chance that one bound fails where everything is right: a test with up to ten of them fails in less than 1 of 1000 runs."""


@dataclass(frozen=True)
class Study:
    """Calibrations (n) of machines whose deviations are known, and the errors (n, p) of the parameters."""

    calibrations: list[gtpin.Calibration]
    machines: list[Machine]

    @property
    def z(self) -> Floats:
        """(n, p) errors in units of the sigmas that were told."""
        return np.array([error / c.sigma for error, c in zip(self.errors, self.calibrations, strict=True)])

    @property
    def errors(self) -> list[Floats]:
        return [
            c.model.geometry.deviation - np.array([m.deviations[name] for name in c.names])
            for c, m in zip(self.calibrations, self.machines, strict=True)
        ]

    def assert_covers(self, pooled: float | None = None) -> None:
        """95 % intervals cover as often as they say: pooled over parameters, and for each."""
        z = self.z
        n, p = z.shape
        inside = np.abs(z) < 1.959964
        # Errors of one machine are correlated: the spread of its share is that of normal draws with such correlations.
        rng = np.random.default_rng(0)
        draws = rng.multivariate_normal(np.zeros(p), self.calibrations[0].correlation, size=4000, check_valid="ignore")
        spread = (np.abs(draws) < 1.959964).mean(axis=1).std() / np.sqrt(n)
        bound = 4.0 * spread if pooled is None else pooled
        assert abs(inside.mean() - 0.95) < bound, (inside.mean(), bound)
        # The smallest of p binomial counts falls below this with probability ONCE at most.
        least = binom.ppf(ONCE / p, n, 0.95)
        worst = int(np.argmin(inside.sum(axis=0)))
        assert inside[:, worst].sum() >= least, (self.calibrations[0].names[worst], inside[:, worst].mean(), least / n)

    def assert_unbiased(self) -> None:
        """The mean error of every parameter is what chance allows: normal of variance 1 / n in units of sigma."""
        z = self.z
        n, p = z.shape
        bound = np.sqrt(chi2.isf(ONCE / p, 1) / n)
        worst = int(np.argmax(np.abs(z.mean(axis=0))))
        assert abs(z.mean(axis=0)[worst]) < bound, (self.calibrations[0].names[worst], z.mean(axis=0)[worst], bound)

    def assert_covariance(self) -> None:
        """All errors together follow the covariance that was told: their squares, whitened by it, are chi-square."""
        total = sum(
            float(e @ np.linalg.solve(c.covariance, e)) for e, c in zip(self.errors, self.calibrations, strict=True)
        )
        assert_chi2(total, sum(len(e) for e in self.errors))

    def assert_fits(self) -> None:
        """Chi-square per degree of freedom is 1 within its error."""
        assert_chi2(sum(c.chi2 for c in self.calibrations), sum(c.dof for c in self.calibrations))


def assert_chi2(total: float, freedoms: float) -> None:
    """A sum of squares is one that chi-square of so many freedoms gives, but for two tails of ONCE / 2."""
    assert chi2.ppf(ONCE / 2, freedoms) < total < chi2.isf(ONCE / 2, freedoms), total / freedoms


def study(make: Callable[[np.random.Generator], Case], n: int, **options: object) -> Study:
    """Calibrate n machines, each of its own stream of random numbers."""
    calibrations, machines = [], []
    for seed in range(n):
        machine, dataset = make(np.random.default_rng([seed, n]))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of poses set aside: counted, where it matters
            calibrations.append(gtpin.calibrate(dataset, **options))
        machines.append(machine)
    return Study(calibrations, machines)
