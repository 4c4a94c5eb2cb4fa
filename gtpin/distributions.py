"""Tails and quantiles of distributions from `scipy.special`, because the import of `scipy.stats` takes a second."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import special

Numbers = float | npt.NDArray[np.float64]


class ChiSquare:
    """The chi-square distribution of ``dof`` degrees of freedom."""

    def cdf(self, x: Numbers, dof: Numbers) -> Any:
        """Probability of a value up to ``x``."""
        return special.chdtr(_positive(dof), np.maximum(x, 0.0))

    def sf(self, x: Numbers, dof: Numbers) -> Any:
        """Probability of a value above ``x``."""
        return special.chdtrc(_positive(dof), np.maximum(x, 0.0))

    def ppf(self, chance: Numbers, dof: Numbers) -> Any:
        """The value that is not exceeded with the probability ``chance``."""
        return 2.0 * special.gammaincinv(_positive(dof) / 2.0, chance)

    def isf(self, chance: Numbers, dof: Numbers) -> Any:
        """The value that is exceeded with the probability ``chance``."""
        return special.chdtri(_positive(dof), chance)

    def median(self, dof: Numbers) -> Any:
        """The median: the value that is exceeded with the probability 1/2."""
        return self.ppf(0.5, dof)


class F:
    """The F distribution of ``above`` and ``below`` degrees of freedom, of the numerator and of the denominator."""

    def sf(self, x: Numbers, above: Numbers, below: Numbers) -> Any:
        """Probability of a value above ``x``."""
        return special.fdtrc(above, below, np.maximum(x, 0.0))

    def isf(self, chance: Numbers, above: Numbers, below: Numbers) -> Any:
        """The value that is exceeded with the probability ``chance``."""
        return special.fdtri(above, below, 1.0 - np.asarray(chance))


class Student:
    """Student's t distribution of ``dof`` degrees of freedom."""

    def isf(self, chance: Numbers, dof: Numbers) -> Any:
        """The value that is exceeded with the probability ``chance``."""
        return -special.stdtrit(dof, chance)


class Normal:
    """The standard normal distribution."""

    def sf(self, x: Numbers) -> Any:
        """Probability of a value above ``x``."""
        return special.ndtr(-np.asarray(x))

    def isf(self, chance: Numbers) -> Any:
        """The value that is exceeded with the probability ``chance``."""
        return -special.ndtri(chance)


def _positive(dof: Numbers) -> Any:
    """The degrees of freedom where they are above 0, else NaN."""
    return np.where(np.asarray(dof) > 0.0, dof, np.nan)


chi2, f, t, norm = ChiSquare(), F(), Student(), Normal()


def truncated(mean: float, sigma: float) -> tuple[float, float]:
    """Mean and standard deviation of the normal distribution N(``mean``, ``sigma``^2) that is truncated to values above 0.

    They are mean + sigma h and sigma sqrt(1 - a h - h^2), with a = mean / sigma, h = phi(a) / Phi(a), and phi and Phi the
    density and the cumulative distribution of the standard normal distribution (Johnson, Kotz and Balakrishnan, Continuous
    Univariate Distributions 1, 1994, chapter 13). For a below -30, where Phi(a) becomes too small for a float, they are those
    of the limit: an exponential distribution, whose mean and standard deviation are sigma / |a|.
    """
    a = mean / sigma
    if a < -30.0:
        return sigma / -a, sigma / -a
    h = math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi) / float(special.ndtr(a))
    return mean + sigma * h, sigma * math.sqrt(max(1.0 - a * h - h * h, 0.0))


def interval_above_0(mean: float, sigma: float) -> tuple[float, float]:
    """The 95 % interval of the distribution of :func:`truncated`."""
    above, ends = float(norm.sf(-mean / sigma)), (0.975, 0.025)
    if above < 1e-12:
        low, high = (sigma**2 / mean * math.log(share) for share in ends)
    else:
        low, high = (max(mean + sigma * float(norm.isf(share * above)), 0.0) for share in ends)
    return low, high
