"""Scatter of the machine and what its model does not explain: the excess of errors over noise and the model's uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.distributions import truncated_mean

Floats = npt.NDArray[np.float64]


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
        """What is left: the mean of its posterior, with a flat prior on variances from 0 up.

        Errors are about isotropic normal vectors, so that the mean square of N of them varies by sqrt(2 / (3 N)) of itself. A
        variance of which the data say little is not 0: without an excess it is 0.8 of this doubt.
        """
        left = self.observed - self.instrument + (self.posterior if self.fitted else -self.posterior)
        return truncated_mean(left, self.doubt)

    @property
    def doubt(self) -> float:
        """Standard uncertainty of the observed mean square."""
        return self.observed * float(np.sqrt(2.0 / (3.0 * self.rows)))


def mean_trace(covariance: Floats) -> float:
    """Mean trace of covariances (N, 3, 3)."""
    return float(np.trace(covariance, axis1=1, axis2=2).mean())
