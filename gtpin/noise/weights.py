"""Weights of poses in a fit: zero for gross errors, reduced where the noise has heavy tails."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import gammaln

from gtpin.distributions import chi2, f
from gtpin.typing import Floats, Mask

REJECTION = 1e-3
"""Probability that any good pose of a dataset is set aside, for Gaussian noise. Assumed."""
LEFT_OUT = 10.0
"""Norm of a residual, in units of the residuals' robust scale, beyond which a row has weight zero in a rough fit. Assumed."""
ABSURD = 15.0
"""Norm of a residual, in units of the residuals' robust scale, beyond which a row is a gross error however heavy the tails
are: a few gross errors of a single number look like tails that explain them. Assumed; as ``absurd`` of a diagnosis."""
FEW = 0.1
"""Largest share of the rows that can be absurd: more of them are no gross errors, but something that acts on a part of the
poses. Assumed."""
TAIL_Z = 4.0
"""Standard errors by which the fourth moment must be larger than a Gaussian's for tails to count as heavy. Assumed."""
FREEDOMS = (2.5, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 30.0)
"""Degrees of freedom of the t distributions that are tried."""
SETTLED = 0.01
"""Relative change of a tail's scale below which it has converged."""


def square_norms(residual: Floats) -> Floats:
    """(N,) squared length of the whitened residuals (N, c)."""
    return np.asarray((residual**2).sum(axis=1))


def robust_scale(residual: Floats) -> float:
    """Robust scale: the size of the whitened residuals (N, c) in units of the noise, from their median; at least 1.

    It is 1 where the model fits, and larger where the model is not complete. Outliers are then compared with the other
    residuals and not with the noise.
    """
    return max(1.0, float(np.sqrt(np.median(square_norms(residual)) / chi2.median(residual.shape[1]))))


def huber(residual: Floats) -> Floats:
    """(N,) weights that limit the influence of poses whose residual (N, c) exceeds its 95 % point (Huber 1964).

    A pose beyond ``LEFT_OUT`` has weight zero: its squared residual would leave no significant digits to the others.
    """
    norm = np.sqrt(square_norms(residual)) / robust_scale(residual)
    bound = np.sqrt(chi2.ppf(0.95, residual.shape[1]))
    return np.where(norm > LEFT_OUT, 0.0, np.minimum(1.0, bound / np.maximum(norm, 1e-300)))


def gross(residual: Floats, used: Mask) -> Mask:
    """(N,) whether noise with the size and tails of the other poses' residuals does not explain a pose's residual.

    ``residual``: (N, c) whitened residuals, of all poses. ``used``: (N,) poses that the fit used.
    """
    return np.asarray(square_norms(residual) > gross_limit(residual, used))


def gross_limit(residual: Floats, used: Mask, heaviest: float = np.inf) -> float:
    """Squared length of a whitened residual from which :func:`gross` rejects its row.

    ``heaviest``: upper limit of the degrees of freedom of the t distribution that is assumed for good poses.
    """
    tails = Tails(min(Tails.of(residual[used]).freedom, heaviest))
    limit = tails.quantile(REJECTION / max(1, len(residual)), residual.shape[1])
    scale = robust_scale(residual[used]) ** 2
    if limit > ABSURD**2 and (square_norms(residual) > ABSURD**2 * scale).mean() <= FEW:
        limit = ABSURD**2
    return limit * scale


@dataclass(frozen=True)
class Tails:
    """Tails of the noise: of a Gaussian or of a multivariate t distribution.

    ``freedom``: degrees of freedom of the t distribution; infinite for Gaussian noise. ``scale``: scale of the t
    distribution, in units of the noise.
    """

    freedom: float = np.inf
    scale: float = 1.0

    @staticmethod
    def of(residual: Floats) -> Tails:
        """Tails estimated from whitened residuals (N, c); Gaussian unless these are clearly heavier."""
        count, c = residual.shape
        norms = square_norms(residual)
        typical = np.median(norms) / chi2.median(c)
        if typical <= 0.0:
            return Tails()
        # Mardia's kurtosis (1970), with the largest values limited: one gross error does not make the tails heavy.
        limit = chi2.isf(0.5 / count, c)
        cut = np.minimum(norms / max(1.0, typical), limit)
        expected = np.minimum(_chi_squares(c), limit) ** 2
        z = ((cut**2).mean() - expected.mean()) / (expected.std() / np.sqrt(count))
        if z < TAIL_Z:
            return Tails()
        found = [(t_likelihood(norms, freedom, c), freedom) for freedom in FREEDOMS]
        (_, scale), freedom = max(found)
        return Tails(freedom, scale)

    @property
    def heavy(self) -> bool:
        """Whether they are heavier than Gaussian."""
        return bool(np.isfinite(self.freedom))

    def weigh(self, residual: Floats) -> Floats:
        """(N,) weights with which reweighted least squares maximises the likelihood."""
        if not self.heavy:
            return np.ones(len(residual))
        c = residual.shape[1]
        return np.asarray((self.freedom + c) / (self.freedom * self.scale**2 + square_norms(residual)))

    def kept(self, components: int) -> float:
        """Fisher information of the t distribution divided by that of the weighted least squares; 1 for a Gaussian."""
        if not self.heavy:
            return 1.0
        return (self.freedom + components) / (self.freedom + components + 2.0)

    def quantile(self, tail: float, components: int) -> float:
        """Squared norm that a residual exceeds with probability ``tail``, for scale 1."""
        if not self.heavy:
            return float(chi2.isf(tail, components))
        return float(components * f.isf(tail, components, self.freedom))


@cache
def _chi_squares(c: int) -> Floats:
    """2,000 values of chi-square with c degrees of freedom, at evenly spaced probabilities; they take longer than the rest."""
    values = np.asarray(chi2.ppf((np.arange(2000) + 0.5) / 2000, c))
    values.flags.writeable = False
    return values


def t_likelihood(norms: Floats, freedom: float, c: int) -> tuple[float, float]:
    """Log likelihood of squared norms under a t distribution, and the scale that maximises it."""
    scale2 = float(np.median(norms) / chi2.median(c))
    for _ in range(50):
        scale2 = float(((freedom + c) * norms / (freedom + norms / scale2)).mean() / c)
    constant = gammaln((freedom + c) / 2.0) - gammaln(freedom / 2.0) - c / 2.0 * np.log(freedom * np.pi)
    terms = constant - c / 2.0 * np.log(scale2) - (freedom + c) / 2.0 * np.log1p(norms / (freedom * scale2))
    return float(terms.sum()), float(np.sqrt(scale2))
