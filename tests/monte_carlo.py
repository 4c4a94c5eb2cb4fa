"""Many machines calibrated, and what a correct estimator's errors can be."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binom, chi2

import gtpin

Floats = np.ndarray

ONCE = 1e-4
"""Chance that one bound fails where everything is right: a test with up to ten of them fails in less than 1 of 1000 runs."""
INSIDE = 1.959964
"""Errors over their sigma within which 95 % of normal draws are."""


@dataclass(frozen=True)
class Study:
    """Calibrations of n machines, whose ``deviations`` have by name what is true: of parameters, and of instruments' unknowns.

    Parameters without a true deviation are left out of everything: nothing of the machine moves with them.
    """

    calibrations: list[gtpin.Calibration]
    machines: list[Any]

    @property
    def truths(self) -> list[Mapping[str, float]]:
        return [machine.deviations for machine in self.machines]

    @property
    def known(self) -> list[int]:
        """Indices of the p parameters whose deviations are known."""
        return [i for i, name in enumerate(self.calibrations[0].names) if name in self.truths[0]]

    @property
    def errors(self) -> Floats:
        """(n, p) errors of the parameters."""
        found = [c.model.geometry.deviation[self.known] for c in self.calibrations]
        names = [self.calibrations[0].names[i] for i in self.known]
        return np.array(found) - [[truth[name] for name in names] for truth in self.truths]

    @property
    def z(self) -> Floats:
        """(n, p) errors in units of the sigmas that were told."""
        return self.errors / [c.sigma[self.known] for c in self.calibrations]

    @property
    def z_unknown(self) -> Floats:
        """(n, k) errors of the instruments' unknowns in units of the sigmas that were told."""
        found = []
        for c, truth in zip(self.calibrations, self.truths, strict=True):
            told = [(c.unknown(one.name), truth[one.name]) for one in c.unknowns]
            found.append([(estimate.value - value) / estimate.sigma for estimate, value in told])
        return np.array(found)

    def assert_covers(self, pooled: float | None = None) -> None:
        """95 % intervals cover as often as they say: pooled over parameters, and for each."""
        correlation = self.calibrations[0].correlation[np.ix_(self.known, self.known)]
        self.assert_inside(self.z, 4.0 * self.spread(correlation) if pooled is None else pooled)

    def assert_covers_unknowns(self) -> None:
        """The same for the instruments' unknowns, and these are unbiased."""
        self.assert_inside(self.z_unknown, 4.0 * self.spread_unknown)
        assert_no_bias(self.z_unknown)

    @property
    def spread_unknown(self) -> float:
        """Standard error of the share of unknowns inside their 95 % intervals, as correlated as they are told to be."""
        covariance = self.calibrations[0].u_covariance
        sigma = np.sqrt(np.diagonal(covariance))
        return self.spread(covariance / np.outer(sigma, sigma))

    def spread(self, correlation: Floats) -> float:
        """Standard error of the share inside: that of one machine is that of normal draws with such correlations."""
        rng = np.random.default_rng(0)
        draws = rng.multivariate_normal(np.zeros(len(correlation)), correlation, size=4000, check_valid="ignore")
        return float((np.abs(draws) < INSIDE).mean(axis=1).std() / np.sqrt(len(self.calibrations)))

    def assert_inside(self, z: Floats, bound: float) -> None:
        """Errors z (n, p) are within their 95 % intervals as often as that: pooled up to a bound, and each."""
        inside = np.abs(z) < INSIDE
        assert abs(inside.mean() - 0.95) < bound, (inside.mean(), bound)
        # The smallest of p binomial counts falls below this with probability ONCE at most.
        assert inside.sum(axis=0).min() >= binom.ppf(ONCE / z.shape[1], len(z), 0.95), inside.mean(axis=0)

    def assert_unbiased(self) -> None:
        """The mean error of every parameter is what chance allows."""
        assert_no_bias(self.z)

    def assert_covariance(self) -> None:
        """All errors together follow the covariance that was told: their squares, whitened by it, are chi-square."""
        rows, errors = np.ix_(self.known, self.known), self.errors
        pairs = zip(errors, self.calibrations, strict=True)
        assert_chi2(sum(float(e @ np.linalg.solve(c.covariance[rows], e)) for e, c in pairs), errors.size)

    def assert_fits(self) -> None:
        """Chi-square per degree of freedom is 1 within its error."""
        assert_chi2(sum(c.chi2 for c in self.calibrations), sum(c.dof for c in self.calibrations))

    def assert_clean(self, chance: float) -> None:
        """No good row is set aside and no lack of fit is claimed, but with a documented chance for each dataset."""
        most = binom.isf(ONCE, len(self.calibrations), chance)
        assert sum(bool(c.rejected) for c in self.calibrations) <= most
        assert sum(c.sigma_scale > 1.0 or np.isfinite(c.freedom) for c in self.calibrations) <= most


def assert_no_bias(z: Floats) -> None:
    """Means of errors (n, p) in units of sigma are what chance allows: normal of variance 1 / n."""
    bound = np.sqrt(chi2.isf(ONCE / z.shape[1], 1) / len(z))
    assert np.abs(z.mean(axis=0)).max() < bound, (z.mean(axis=0), bound)


def assert_chi2(total: float, freedoms: float) -> None:
    """A sum of squares is one that chi-square of so many freedoms gives, but for two tails of ONCE / 2."""
    assert chi2.ppf(ONCE / 2, freedoms) < total < chi2.isf(ONCE / 2, freedoms), total / freedoms


def study(make: Callable[[np.random.Generator], tuple], n: int, seed: int | None = None, **options: object) -> Study:
    """Calibrate n machines, each of its own stream of random numbers; ``make`` gives a machine and its dataset."""
    calibrations, machines = [], []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of rows set aside: counted, where it matters
        for number in range(n):
            machine, dataset = make(np.random.default_rng([number, n] if seed is None else [seed, number]))
            calibrations.append(gtpin.calibrate(dataset, **options))
            machines.append(machine)
    return Study(calibrations, machines)
