"""The converged state of a calibration's iterations, and whether its noise explains the residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.calibration.gauss_newton import Fit, fit
from gtpin.calibration.problem import Problem
from gtpin.distributions import chi2, f
from gtpin.noise import weights
from gtpin.noise.noise import Noise

Mask = npt.NDArray[np.bool_]

CORE = 1.2
"""Ratio of the scale of the fitted t distribution to the noise, above which heavy tails count as a lack of fit too. Assumed."""
LACK_OF_FIT = 1e-3
"""p-value of chi-square below which the model counts as incomplete. Assumed."""


@dataclass(frozen=True)
class Settled:
    """The converged state of the iterations.

    Parameters
    ----------
    fit
        The last fit.
    used
        (N,) the poses that are not gross errors.
    noise, tails
        Noise that the fit assumes, and the tails of its distribution.
    steps
        Number of steps of all fits.
    """

    fit: Fit[Problem]
    used: Mask
    noise: Noise
    tails: weights.Tails
    steps: int

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residuals, without robust weights."""
        return float((self.fit.residual**2).sum())

    @property
    def dof(self) -> float:
        """Measured components minus the effective number of parameters."""
        return self.fit.residual.size - self.fit.taken

    @property
    def excess(self) -> float:
        """Ratio of residuals to noise if chi-square shows a lack of fit; else 1.

        Heavy tails have their own scale, which the fit's weights include.
        """
        if self.tails.heavy:
            return self.tails.scale if self.tails.scale > CORE else 1.0
        known = np.isinf(self.noise.dof)
        chance = chi2.sf(self.chi2, self.dof) if known else f.sf(self.chi2 / self.dof, self.dof, self.noise.dof)
        if chance >= LACK_OF_FIT:
            return 1.0
        return float(np.sqrt(self.chi2 / self.dof))

    def refit(self, factor: float) -> Fit[Problem]:
        """The fit with the noise multiplied by a factor: its covariance includes the model's lack of fit."""
        return fit(self.fit.problem.noisier(factor), self.tails.weigh, self.fit.point.x)
