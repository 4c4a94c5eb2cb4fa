"""The posterior of a model's geometry and effects: a normal distribution, and draws from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from gtpin.typing import Floats

ROUNDING = 1e-9
"""Largest difference, relative to the standard deviations, of a joint covariance from the covariances of its parts."""


def joined(parts: Sequence[Floats], joint: Floats | None) -> Floats:
    """Covariance of all parts together: ``joint`` where its diagonal blocks are the parts, else without cross-covariances.

    Parameters
    ----------
    parts
        (m_i, m_i) covariance of each part: of the geometry, then of each effect's coefficients.
    joint
        (m, m), m the sum of the m_i; None where it is not known.
    """
    apart = np.asarray(block_diag(*parts), dtype=float)
    if joint is None or joint.shape != apart.shape:
        return apart
    sigma = np.sqrt(np.maximum(apart.diagonal(), 0.0))
    inside = np.asarray(block_diag(*(np.ones_like(part) for part in parts)), dtype=bool)
    off = np.abs(joint - apart) > ROUNDING * np.outer(sigma, sigma)
    return apart if (off & inside).any() else joint


def inverse_root(information: Floats) -> Floats:
    """F (m, m) with F F' the inverse of a symmetric matrix with positive eigenvalues.

    From eigenvectors. An inverse that is computed row by row is not symmetric: what the data determine well has variances that
    are far smaller than the difference of its two halves, and a root of either half then has variances that are far too large.
    """
    size = np.sqrt(information.diagonal())
    values, vectors = np.linalg.eigh(information / np.outer(size, size))
    return np.asarray(vectors / np.sqrt(np.maximum(values, np.finfo(float).eps)) / size[:, None])


def block_of(joint: Floats, sizes: Sequence[int], kept: Sequence[bool]) -> Floats:
    """The block of a joint covariance that belongs to some of its parts, whose sizes are given in its order."""
    rows = np.repeat(np.asarray(kept, dtype=bool), sizes)
    return np.asarray(joint[np.ix_(rows, rows)])


def draws(mean: Floats, covariance: Floats, n: int, rng: np.random.Generator) -> Floats:
    """(n, m) draws of a normal distribution with mean (m,) and covariance (m, m), which may be singular."""
    sigma = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    size = np.where(sigma > 0.0, sigma, 1.0)
    # Parameters have different units: the eigenvalues are those of the correlations.
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(mean + rng.standard_normal((n, len(mean))) @ root.T)
