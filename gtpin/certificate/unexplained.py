"""Scatter of the machine and what its model does not explain: the excess of errors over noise and the model's uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.distributions import norm, t, truncated

Floats = npt.NDArray[np.float64]

COVERAGE = 2.0
"""Coverage factor k: 95 % of a normal distribution (JCGM 100, 6.3.3)."""


@dataclass(frozen=True)
class Excess:
    """Mean squares of the lengths of N errors, and of what is expected of them; m^2 or rad^2.

    Parameters
    ----------
    observed
        Of the errors.
    instrument, posterior
        Expected of the instrument's noise, and of the model's uncertainty: mean traces of the covariances.
    rows
        N.
    fitted
        Whether the model was fitted to these rows: residuals are then smaller than the noise by the model's uncertainty, and
        not larger.
    """

    observed: float
    instrument: float
    posterior: float
    rows: int
    fitted: bool = False

    @property
    def power(self) -> float:
        """What is left, so large that k = 2 covers 95 % of the sum with the model's uncertainty in spite of its doubt.

        Errors are about isotropic normal vectors, so that the mean square of N of them varies by sqrt(2 / (3 N)) of itself.
        With a flat prior from 0 up, the variance has a truncated normal posterior of mean m and standard deviation d: as many
        degrees of freedom as nu = 2 (m / d)^2 (JCGM 100, E.4.3 and G.4.2), and its sum with the model's variance v has
        nu ((v + m) / m)^2 (Welch and Satterthwaite, G.4.1). Student's quantile t of these takes the place of k (G.3.2); so that
        k stays 2, the sum is multiplied by (t / 2)^2, and what this adds counts as left.
        """
        left = self.observed - self.instrument + (self.posterior if self.fitted else -self.posterior)
        mean, sd = truncated(left, self.doubt)
        whole = self.posterior + mean
        factor = float(t.isf(norm.sf(COVERAGE), 2.0 * (whole / sd) ** 2)) / COVERAGE
        return whole * factor**2 - self.posterior

    @property
    def doubt(self) -> float:
        """Standard uncertainty of the observed mean square."""
        return self.observed * float(np.sqrt(2.0 / (3.0 * self.rows)))


def mean_trace(covariance: Floats) -> float:
    """Mean trace of covariances (N, 3, 3)."""
    return float(np.trace(covariance, axis1=1, axis2=2).mean())
