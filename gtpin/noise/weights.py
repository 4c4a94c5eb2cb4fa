"""Weights of poses in a fit: gross errors lose theirs, heavy tails keep part of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from gtpin.distributions import chi2, f

Floats = npt.NDArray[np.float64]

REJECTION = 1e-3
"""Chance that a single good pose out of all is set aside, for Gaussian noise."""
ABSURD = 10.0
"""Residual's norm, over that of the bulk, beyond which a pose does not even pull."""
TAIL_Z = 4.0
"""Standard errors by which the fourth moment must exceed a Gaussian's before tails count as heavy."""
FREEDOMS = (2.5, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 30.0)
"""Degrees of freedom of the t distributions that are tried."""


def square_norms(residual: Floats) -> Floats:
    """(N,) squared length of the whitened residuals (N, c)."""
    return np.asarray((residual**2).sum(axis=1))


def robust_scale(residual: Floats) -> float:
    """Size of the whitened residuals in units of the noise, from their median; at least 1.

    It is 1 for a model that fits, more where the model lacks something: what is then far from the bulk is judged
    against the bulk, not against a noise that it does not obey.
    """
    return max(1.0, float(np.sqrt(np.median(square_norms(residual)) / chi2.median(residual.shape[1]))))


def huber(residual: Floats) -> Floats:
    """(N,) weights that bound the pull of a pose beyond the 95 % point of its residual's norm (Huber 1964).

    A pose that is absurdly far out has none: its share of the cost would leave no digits to the others.
    """
    norm = np.sqrt(square_norms(residual)) / robust_scale(residual)
    bound = np.sqrt(chi2.ppf(0.95, residual.shape[1]))
    return np.where(norm > ABSURD, 0.0, np.minimum(1.0, bound / np.maximum(norm, 1e-300)))


def gross(residual: Floats, used: npt.NDArray[np.bool_], heaviest: float = np.inf) -> npt.NDArray[np.bool_]:
    """(N,) poses whose residual no noise of the size and tails of the others explains.

    Parameters
    ----------
    residual
        (N, c) whitened residuals, of all poses.
    used
        (N,) poses that the fit used.
    heaviest
        Freedoms of a t distribution whose tails good poses may have, although they do not show them.
    """
    components = residual.shape[1]
    norms = square_norms(residual)
    tails = Tails(min(Tails.of(residual[used]).freedom, heaviest))
    limit = tails.quantile(REJECTION / max(1, len(norms)), components) * robust_scale(residual[used]) ** 2
    return np.asarray(norms > limit)


@dataclass(frozen=True)
class Tails:
    """Tails of the noise: Gaussian, or those of a multivariate t.

    Parameters
    ----------
    freedom
        Degrees of freedom of the t distribution; infinite for Gaussian noise.
    scale
        Size of the whitened residuals' core in units of the noise.
    """

    freedom: float = np.inf
    scale: float = 1.0

    @staticmethod
    def of(residual: Floats) -> Tails:
        """The tails that whitened residuals (N, c) show; Gaussian unless they show otherwise."""
        count, c = residual.shape
        norms = square_norms(residual)
        typical = np.median(norms) / chi2.median(c)
        if typical <= 0.0:
            return Tails()
        # Mardia's kurtosis, with the largest values cut off: one gross error is no tail.
        limit = chi2.isf(0.5 / count, c)
        cut = np.minimum(norms / max(1.0, typical), limit)
        grid = chi2.ppf((np.arange(2000) + 0.5) / 2000, c)
        expected = np.minimum(grid, limit) ** 2
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
        """(N,) weights by which reweighted least squares maximises the likelihood."""
        if not self.heavy:
            return np.ones(len(residual))
        c = residual.shape[1]
        return np.asarray((self.freedom + c) / (self.freedom * self.scale**2 + square_norms(residual)))

    def kept(self, components: int) -> float:
        """Information of the data over that of the weighted least squares that fits them."""
        if not self.heavy:
            return 1.0
        return (self.freedom + components) / (self.freedom + components + 2.0)

    def quantile(self, tail: float, components: int) -> float:
        """Squared norm that a residual exceeds with probability ``tail``, for a core of unit size."""
        if not self.heavy:
            return float(chi2.isf(tail, components))
        return float(components * f.isf(tail, components, self.freedom))


def t_likelihood(norms: Floats, freedom: float, c: int) -> tuple[float, float]:
    """Log likelihood of squared norms under a t distribution, and the scale that maximises it."""
    scale2 = float(np.median(norms) / chi2.median(c))
    for _ in range(50):
        scale2 = float(((freedom + c) * norms / (freedom + norms / scale2)).mean() / c)
    constant = gammaln((freedom + c) / 2.0) - gammaln(freedom / 2.0) - c / 2.0 * np.log(freedom * np.pi)
    terms = constant - c / 2.0 * np.log(scale2) - (freedom + c) / 2.0 * np.log1p(norms / (freedom * scale2))
    return float(terms.sum()), float(np.sqrt(scale2))
