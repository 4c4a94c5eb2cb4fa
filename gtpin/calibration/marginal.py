"""The marginal likelihood of a fit: how probable its data are with some noise, and with tolerances wider by some factor.

About a fit at x, the residuals in m and rad are r - B (x' - x), with x' the unknowns. Geometry and instruments' unknowns have
Gaussian priors, so they integrate out in closed form, and what is left is a function of the noise's sigmas and of the factor on
the tolerances. Sigmas and factor are found by fixed-point steps: D. J. C. MacKay, "Bayesian interpolation", Neural Computation
4 (1992) 415-447, equations 4.9 to 4.11. The function has two kinds of maxima: small noise with a geometry far from nominal, and
large noise with a nominal geometry. Each is found from its own start.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve

from gtpin.calibration.gauss_newton import Fit
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.typing import Floats, Mask

WIDEST = 100.0
"""Largest factor on the tolerances. Assumed: a robot that is farther from nominal is another robot."""


@dataclass(frozen=True)
class Maximum:
    """Maximum-likelihood noise and factor on the tolerances, with their log marginal likelihood."""

    noise: ReadingNoise
    factor: float
    log_likelihood: float


@dataclass(frozen=True)
class MarginalLikelihood:
    """Sums over the data from which the marginal likelihood follows, for G groups of numbers and k unknowns.

    - ``noise``: noise of the fitted rows. Sigmas that it marks as estimated are open; its repeatability is not used.
    - ``squares``, ``counts``, ``moments``, ``grams``: (G + 1,), (G + 1,), (G + 1, k), (G + 1, k, k): of the numbers of each
      group with its common sigma, the sum of squared residuals r'r, m^2 or rad^2, their number, B'r and B'B. The last group
      has all numbers whose rows declare their own sigma, in units of these sigmas; they are not counted.
    - ``x``, ``prior``: (k,) unknowns of the fit, and the inverse variances of their priors.
    - ``widened``: (k,) unknowns to whose priors the factor applies.
    """

    noise: ReadingNoise
    squares: Floats
    counts: Floats
    moments: Floats
    grams: Floats
    x: Floats
    prior: Floats
    widened: Mask

    @staticmethod
    def of(outcome: Fit, noise: ReadingNoise, weight: Floats, widened: Mask) -> MarginalLikelihood:
        """Sum over a fit's rows, with weights (N,); ``noise`` is that of these rows."""
        problem, groups, k = outcome.problem, len(noise.sigma) + 1, outcome.problem.size
        c = outcome.residual.shape[1]
        # Sigmas of 1 m or rad where rows declare none, and without the drives' part.
        unit = replace(noise, sigma=np.ones_like(noise.sigma), repeatability=0.0)
        plain = replace(problem, whitening=unit.whitening(np.zeros((len(weight), c, 1)), c))
        residual = plain.residual(outcome.point)
        squares, counts = np.zeros(groups), np.zeros(groups)
        moments, grams = np.zeros((groups, k)), np.zeros((groups, k, k))
        own = np.isfinite(noise.row_sigma)
        for rows in plain.chunks():
            B = plain.jacobian(outcome.point, rows, weight[rows])
            r = residual[rows] * np.sqrt(weight[rows])[:, None]
            of = np.where(own[rows], groups - 1, noise.group[rows])
            counted = np.where(own[rows], 0.0, weight[rows][:, None])
            for group in np.unique(of):
                mine = of == group
                some, left = B[mine], r[mine]
                squares[group] += float(left @ left)
                counts[group] += float(counted[mine].sum())
                moments[group] += some.T @ left
                grams[group] += some.T @ some
        return MarginalLikelihood(noise, squares, counts, moments, grams, outcome.point.x[:k], problem.prior, widened)

    def in_units(self, scale: Floats) -> MarginalLikelihood:
        """The same for unknowns in other units: each is ``scale`` (k,) times as large; the priors hold in the new units."""
        grams = self.grams / np.outer(scale, scale)
        return replace(self, moments=self.moments / scale, grams=grams, x=self.x * scale)

    @property
    def scatter(self) -> Floats:
        """(G,) sigmas that the data would have at x = 0, with the nominal geometry: the noise of the other start."""
        at = self.squares + 2.0 * self.moments @ self.x + np.einsum("i,gij,j->g", self.x, self.grams, self.x)
        return np.asarray(np.sqrt(np.maximum(at, 0.0) / np.maximum(self.counts, 1.0)))[:-1]

    def best(self, sigma: Floats, *, widen: bool) -> Maximum:
        """The maximum that is found from some sigmas (G,); ``widen``: whether the factor on the tolerances is open too."""
        given, factor = np.append(self.noise.sigma, 1.0), 1.0
        is_open = np.append(self.noise.estimated, False) & (self.counts > 0.0)
        sigma = np.where(is_open, np.maximum(np.append(sigma, 1.0), SMALLEST), given)
        for _ in range(200):
            prior, A, b = self._normal(sigma, factor)
            covariance = cho_solve((_factor(A), True), np.eye(len(A)))
            step = covariance @ b
            left = self.squares - 2.0 * self.moments @ step + np.einsum("i,gij,j->g", step, self.grams, step)
            effective_parameters = np.einsum("ij,gij->g", covariance, self.grams) / sigma**2
            free = np.maximum(self.counts - effective_parameters, 1e-3 * np.maximum(self.counts, 1.0))
            now = np.where(is_open, np.maximum(np.sqrt(np.maximum(left, 0.0) / free), SMALLEST), sigma)
            wider = factor
            if widen:
                at = (self.x + step)[self.widened]
                sure = self.widened.sum() - (np.diag(covariance) * prior)[self.widened].sum()
                power = float((self.prior[self.widened] * at**2).sum())
                wider = float(np.clip(np.sqrt(power / max(float(sure), 1e-6)), 1.0, WIDEST))
            changed = max(np.abs(now / sigma - 1.0).max(initial=0.0), abs(wider / factor - 1.0))
            sigma, factor = now, wider
            if changed < 1e-4:
                break
        prior, A, b = self._normal(sigma, factor)
        lower = _factor(A)
        power = float(self.squares @ sigma**-2.0) + float(self.x @ (prior * self.x))
        power -= float(b @ cho_solve((lower, True), b))
        volume = float(self.counts @ np.log(sigma)) + float(np.log(np.diag(lower)).sum())
        log_likelihood = -0.5 * power - volume - float(self.widened.sum()) * float(np.log(factor))
        return Maximum(replace(self.noise, sigma=sigma[:-1]), factor, log_likelihood)

    def _normal(self, sigma: Floats, factor: float) -> tuple[Floats, Floats, Floats]:
        """The priors' inverse variances (k,), and the normal equations (k, k) and (k,) about x."""
        prior = np.where(self.widened, self.prior / factor**2, self.prior)
        A = np.einsum("g,gij->ij", sigma**-2.0, self.grams) + np.diag(prior)
        return prior, A, sigma**-2.0 @ self.moments - prior * self.x


def _factor(A: Floats) -> Floats:
    """Lower Cholesky factor; directions that nothing determines get a prior so wide that it has no influence."""
    return np.asarray(np.linalg.cholesky(A + 1e-12 * np.diag(np.diag(A)) + 1e-30 * np.eye(len(A))))
