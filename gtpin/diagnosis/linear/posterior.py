"""The posterior of some groups of displacements together, and the gain by one more group."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigh
from scipy.linalg.lapack import dpotri

from gtpin.diagnosis.linear.evidence import Groups, best_scales
from gtpin.typing import Floats

K = TypeVar("K", bound=Hashable)
"""Type of a group's key."""


@dataclass(frozen=True)
class Posterior(Generic[K]):
    """A model of some groups.

    - ``terms``: the groups.
    - ``widths``: number of coefficients of each.
    - ``scale``: scale of each group.
    - ``log_evidence``: log evidence relative to the model without a group, with the scales' priors, nats.
    - ``mean``, ``covariance``: mean (n,) and covariance (n, n) of the coefficients of all groups, in units of their typical
      sizes.
    """

    terms: tuple[K, ...]
    widths: tuple[int, ...]
    scale: tuple[float, ...]
    log_evidence: float
    mean: Floats
    covariance: Floats


NOTHING: Posterior[Any] = Posterior((), (), (), 0.0, np.zeros(0), np.zeros((0, 0)))
"""The model without a group."""


def fixed(groups: Groups[K], terms: Sequence[K], scale: Sequence[float]) -> Posterior[K]:
    """The model of some groups with given scales."""
    if not terms:
        return NOTHING
    widths = tuple(groups.width(n) for n in terms)
    sizes = np.repeat(np.asarray(scale, dtype=float), widths)
    M = np.vstack([groups.across(n, terms) for n in terms]) * np.outer(sizes, sizes)
    u = np.concatenate([groups.moment(n) for n in terms]) * sizes
    factor = _factor(M)
    w = cho_solve(factor, u)
    prior = sum(scale_prior(groups, s) for s in scale)
    log_evidence = 0.5 * float(u @ w) - float(np.log(np.diag(factor[0])).sum()) + prior
    lower = np.tril(dpotri(factor[0], lower=1)[0])
    covariance = (lower + np.tril(lower, -1).T) * np.outer(sizes, sizes)
    return Posterior(tuple(terms), widths, tuple(scale), log_evidence, w * sizes, covariance)


def _factor(M: Floats) -> tuple[Floats, bool]:
    """Cholesky factor of 1 + M for a Gram matrix M, without the negative eigenvalues that rounding errors may give it.

    M is a difference, with the geometry marginalised. Its rounding errors count where the noise is very small and the geometry
    absorbs nearly all of a group.
    """
    one = np.eye(len(M))
    try:
        return cho_factor(one + M, lower=True)
    except LinAlgError:
        values, vectors = eigh(M)
        return cho_factor(one + (vectors * np.maximum(values, 0.0)) @ vectors.T, lower=True)


def scale_prior(groups: Groups[Any], scale: float) -> float:
    """Log of the prior density of ln(scale), relative to scale 1."""
    return -0.5 * float(np.log(scale) / groups.priors.scale_spread) ** 2


def given(groups: Groups[K], model: Posterior[K], term: K) -> tuple[Floats, Floats]:
    """(c, c) inner products of a group with itself and (c,) with the residual, geometry and a model marginalised."""
    across = groups.across(term, model.terms)
    gram = groups.block(term, term) - across @ model.covariance @ across.T
    return gram, groups.moment(term) - across @ model.mean


def gain(groups: Groups[K], model: Posterior[K], term: K) -> tuple[float, float]:
    """Largest gain in log evidence by adding a group to a model, and the scale that gives it."""
    return all_gains(groups, model, (term,))[term]


def all_gains(groups: Groups[K], model: Posterior[K], terms: Iterable[K]) -> dict[K, tuple[float, float]]:
    """As :func:`gain`, for each of several groups."""
    alike: dict[tuple[int, tuple[int, ...]], list[K]] = defaultdict(list)
    for term in terms:
        width = groups.width(term)
        alike[1 << (width - 1).bit_length(), groups.core[term]].append(term)
    found: dict[K, tuple[float, float]] = {}
    for (_, core), members in alike.items():
        # Groups of similar width are filled up to one width with columns of zeros, which do not change the gain.
        width = max(groups.width(term) for term in members)
        grams, moments = np.zeros((len(members), width, width)), np.zeros((len(members), width))
        for i, term in enumerate(members):
            gram, moment = given(groups, model, term)
            grams[i, : len(moment), : len(moment)], moments[i, : len(moment)] = gram, moment
        best = zip(*best_scales(grams, moments, core, groups.priors), strict=True)
        found |= {term: (float(g), float(s)) for term, (g, s) in zip(members, best, strict=True)}
    return found
