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
import numpy.typing as npt
from scipy.linalg import cho_solve

from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.problem import Problem
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.typing import Floats

STEPS = 200
"""Most fixed-point steps."""
SETTLED = 1e-4
"""Relative change of sigmas and factor below which they have converged."""
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
    - ``squares``, ``counts``, ``moments``, ``grams``: (G,), (G,), (G, k), (G, k, k): of the numbers of each group with its
      common sigma, the sum of squared residuals r'r, m^2 or rad^2, their number, B'r and B'B.
    - ``known``: the same for all other numbers, whose rows declare their own sigma: r'r, B'r and B'B in units of these
      sigmas.
    - ``x``, ``prior``: (k,) unknowns of the fit, and the inverse variances of their priors.
    - ``widened``: (k,) unknowns to whose priors the factor applies.
    """

    noise: ReadingNoise
    squares: Floats
    counts: Floats
    moments: Floats
    grams: Floats
    known: tuple[float, Floats, Floats]
    x: Floats
    prior: Floats
    widened: npt.NDArray[np.bool_]

    @staticmethod
    def of(
        outcome: Fit[Problem],
        noise: ReadingNoise,
        weight: Floats,
        widened: npt.NDArray[np.bool_],
    ) -> MarginalLikelihood:
        """Sum over a fit's rows, with weights (N,); ``noise`` is that of these rows."""
        problem, groups, k = outcome.problem, len(noise.sigma), outcome.problem.size
        c = outcome.residual.shape[1]
        unit = noise.of_unit_sigma()
        plain = replace(problem, whitening=unit.whitening(np.zeros((len(weight), c, 1)), c))
        residual = plain.residual(outcome.point)
        squares, counts = np.zeros(groups), np.zeros(groups)
        moments, grams = np.zeros((groups, k)), np.zeros((groups, k, k))
        of_known, b_known, A_known = 0.0, np.zeros(k), np.zeros((k, k))
        own = np.isfinite(noise.row_sigma)
        for rows in plain.chunks():
            root = np.sqrt(weight[rows])[:, None]
            B = plain.jacobian(outcome.point, rows, weight[rows])
            r = residual[rows] * root
            of = np.where(own[rows], -1, noise.group[rows])
            for group in np.unique(of):
                mine = of == group
                some, left = B[mine], r[mine]
                if group < 0:
                    of_known += float(left @ left)
                    b_known += some.T @ left
                    A_known += some.T @ some
                    continue
                squares[group] += float(left @ left)
                counts[group] += float(np.broadcast_to(weight[rows][:, None], mine.shape)[mine].sum())
                moments[group] += some.T @ left
                grams[group] += some.T @ some
        x = outcome.point.x[:k]
        known = (of_known, b_known, A_known)
        return MarginalLikelihood(noise, squares, counts, moments, grams, known, x, problem.prior, widened)

    def in_units(self, scale: Floats) -> MarginalLikelihood:
        """The same for unknowns in other units: each is ``scale`` (k,) times as large; the priors hold in the new units."""
        A = np.outer(scale, scale)
        of_known, b, gram = self.known
        return replace(
            self,
            moments=self.moments / scale,
            grams=self.grams / A,
            known=(of_known, b / scale, gram / A),
            x=self.x * scale,
        )

    @property
    def open(self) -> npt.NDArray[np.bool_]:
        """(G,) groups whose sigma is to be estimated, and that have rows."""
        return np.asarray(self.noise.estimated & (self.counts > 0.0))

    @property
    def scatter(self) -> Floats:
        """(G,) sigmas that the data would have at x = 0, with the nominal geometry: the noise of the other start."""
        at = self.squares + 2.0 * self.moments @ self.x + np.einsum("i,gij,j->g", self.x, self.grams, self.x)
        return np.asarray(np.sqrt(np.maximum(at, 0.0) / np.maximum(self.counts, 1.0)))

    def best(self, sigma: Floats, *, widen: bool) -> Maximum:
        """The maximum that is found from some sigmas (G,); ``widen``: whether the factor on the tolerances is open too."""
        sigma, factor = np.where(self.open, np.maximum(sigma, SMALLEST), self.noise.sigma), 1.0
        for _ in range(STEPS):
            prior = self._prior(factor)
            covariance, step = self._solved(sigma, prior)
            left = self.squares - 2.0 * self.moments @ step + np.einsum("i,gij,j->g", step, self.grams, step)
            taken = np.einsum("ij,gij->g", covariance, self.grams) / sigma**2
            free = np.maximum(self.counts - taken, 1e-3 * np.maximum(self.counts, 1.0))
            now = np.where(self.open, np.sqrt(np.maximum(left, 0.0) / free), sigma)
            now = np.where(self.open, np.maximum(now, SMALLEST), now)
            wider = factor
            if widen:
                at = (self.x + step)[self.widened]
                sure = self.widened.sum() - (np.diag(covariance) * prior)[self.widened].sum()
                power = float((self.prior[self.widened] * at**2).sum())
                wider = float(np.clip(np.sqrt(power / max(float(sure), 1e-6)), 1.0, WIDEST))
            changed = max(np.abs(now / sigma - 1.0).max(initial=0.0), abs(wider / factor - 1.0))
            sigma, factor = now, wider
            if changed < SETTLED:
                break
        return Maximum(replace(self.noise, sigma=sigma), factor, self._log_likelihood(sigma, factor))

    def _prior(self, factor: float) -> Floats:
        return np.where(self.widened, self.prior / factor**2, self.prior)

    def _solved(self, sigma: Floats, prior: Floats) -> tuple[Floats, Floats]:
        """(k, k) posterior covariance, and (k,) the step from x to the posterior mean."""
        A = np.einsum("g,gij->ij", sigma**-2.0, self.grams) + self.known[2] + np.diag(prior)
        b = sigma**-2.0 @ self.moments + self.known[1] - prior * self.x
        covariance = cho_solve((_factor(A), True), np.eye(len(A)))
        return covariance, covariance @ b

    def _log_likelihood(self, sigma: Floats, factor: float) -> float:
        prior = self._prior(factor)
        A = np.einsum("g,gij->ij", sigma**-2.0, self.grams) + self.known[2] + np.diag(prior)
        b = sigma**-2.0 @ self.moments + self.known[1] - prior * self.x
        lower = _factor(A)
        power = float(self.squares @ sigma**-2.0) + self.known[0] + float(self.x @ (prior * self.x))
        power -= float(b @ cho_solve((lower, True), b))
        volume = float(self.counts @ np.log(sigma)) + float(np.log(np.diag(lower)).sum())
        return -0.5 * power - volume - float(self.widened.sum()) * float(np.log(factor))


def _factor(A: Floats) -> Floats:
    """Lower Cholesky factor; directions that nothing determines get a prior so wide that it has no influence."""
    return np.asarray(np.linalg.cholesky(A + 1e-12 * np.diag(np.diag(A)) + 1e-30 * np.eye(len(A))))
