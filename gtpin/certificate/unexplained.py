"""Errors between poses that the model of a machine does not explain: their excess over noise and the model's uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.distributions import norm, t, truncated
from gtpin.typing import Floats

COVERAGE = 2.0
"""Coverage factor k: 95 % of a normal distribution (JCGM 100, 6.3.3)."""


@dataclass(frozen=True)
class Excess:
    """The observed mean square length of errors between poses, and the parts that are expected; m^2 or rad^2.

    Parameters
    ----------
    observed
        Mean square length of the errors at poses that were not fitted.
    noise, posterior
        Expected parts, by the scatter of visits and by the model's uncertainty: mean traces of their covariances.
    freedom
        Degrees of freedom of ``observed``: three for each different pose, less the effective number of fitted parameters.
        Repeated visits of a pose add none.
    """

    observed: float
    noise: float
    posterior: float
    freedom: float

    @property
    def power(self) -> float:
        """The unexplained mean square, enlarged so that coverage factor 2 gives 95 % although it is estimated from few errors.

        Errors are assumed to be isotropic normal vectors: the relative standard deviation of a mean square with f degrees of
        freedom is sqrt(2 / f). With a flat prior on values above 0, the unexplained variance has a truncated normal posterior
        with mean m and standard deviation d. It has nu = 2 (m / d)^2 degrees of freedom (JCGM 100, E.4.3 and G.4.2), and its
        sum with the model's variance v has nu ((v + m) / m)^2 (Welch and Satterthwaite, G.4.1). Student's quantile t for these
        degrees of freedom would replace the coverage factor 2 (G.3.2). To keep the factor 2, the sum is multiplied by (t /
        2)^2, and the increase is added to the unexplained part.
        """
        mean, sd = truncated(self.observed - self.noise - self.posterior, self.doubt)
        whole = self.posterior + mean
        factor = float(t.isf(norm.sf(COVERAGE), 2.0 * (whole / sd) ** 2)) / COVERAGE
        return whole * factor**2 - self.posterior

    @property
    def doubt(self) -> float:
        """Standard uncertainty of the observed mean square."""
        return self.observed * float(np.sqrt(2.0 / self.freedom))


def mean_trace(covariance: Floats) -> float:
    """Mean trace of covariances (N, 3, 3)."""
    return float(np.trace(covariance, axis1=1, axis2=2).mean())
