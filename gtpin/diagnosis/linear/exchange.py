"""A group of several exchanged for one with fewer or more parts: the posterior in closed form, without a new factorisation.

For n coefficients and a part of c the time is of the order n^2 c instead of n^3, and a search exchanges lines thousands of
times. Scales stay.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve

from gtpin.diagnosis.linear.evidence import Groups, Posterior, fixed

Floats = npt.NDArray[np.float64]
K = TypeVar("K")


def exchanged(groups: Groups[K], model: Posterior[K], old: K, new: K) -> Posterior[K]:
    """The model with one group in the place of another, at the same scales.

    Parameters
    ----------
    old, new
        The group that the model has, and the one that it has instead; both are in ``groups``.
    """
    before, after = groups.parts(old), groups.parts(new)
    if len(after) < len(before) and after == tuple(part for part in before if part in after):
        return _less(groups, model, old, new)
    if len(after) > len(before) and after[: len(before)] == before:
        return _more(groups, model, old, new)
    return fixed(groups, tuple(new if term == old else term for term in model.terms), model.scale)


def _less(groups: Groups[K], model: Posterior[K], old: K, new: K) -> Posterior[K]:
    """Fewer parts: the posterior given that the coefficients of the others are zero (Savage and Dickey's ratio)."""
    at = model.terms.index(old)
    place, left = sum(model.widths[:at]), set(groups.parts(new))
    out = np.zeros(len(model.mean), dtype=bool)
    for part in groups.parts(old):
        width = groups.width(part)
        out[place : place + width] = part not in left
        place += width
    C, mean = model.covariance, model.mean
    own = cho_factor(C[np.ix_(out, out)], lower=True)
    across = cho_solve(own, C[np.ix_(out, ~out)])
    ratio = -0.5 * float(mean[out] @ cho_solve(own, mean[out])) - float(np.log(np.diag(own[0])).sum())
    return replace(
        _named(groups, model, at, new),
        log_evidence=model.log_evidence + ratio + int(out.sum()) * float(np.log(model.scale[at])),
        mean=mean[~out] - across.T @ mean[out],
        covariance=C[np.ix_(~out, ~out)] - C[np.ix_(~out, out)] @ across,
    )


def _more(groups: Groups[K], model: Posterior[K], old: K, new: K) -> Posterior[K]:
    """More parts, after those that are there: the posterior by one step of Gaussian elimination."""
    at = model.terms.index(old)
    added = groups.parts(new)[len(groups.parts(old)) :]
    A = np.vstack([groups.across(part, model.terms) for part in added])
    gram = np.block([[groups.block(one, other) for other in added] for one in added]) - A @ model.covariance @ A.T
    moment = np.concatenate([groups.moment(part) for part in added]) - A @ model.mean
    scale, count = model.scale[at], len(moment)
    factor = cho_factor(np.eye(count) / scale**2 + gram, lower=True)
    mean = cho_solve(factor, moment)
    moved = model.covariance @ A.T
    across = -cho_solve(factor, moved.T).T
    n = len(model.mean)
    covariance = np.empty((n + count, n + count))
    covariance[:n, :n] = model.covariance - across @ moved.T
    covariance[:n, n:], covariance[n:, :n] = across, across.T
    covariance[n:, n:] = cho_solve(factor, np.eye(count))
    end = sum(model.widths[: at + 1])
    order = np.r_[:end, n : n + count, end:n]
    gain = 0.5 * float(moment @ mean) - float(np.log(scale * np.diag(factor[0])).sum())
    return replace(
        _named(groups, model, at, new),
        log_evidence=model.log_evidence + gain,
        mean=np.concatenate([model.mean - moved @ mean, mean])[order],
        covariance=covariance[np.ix_(order, order)],
    )


def _named(groups: Groups[K], model: Posterior[K], at: int, new: K) -> Posterior[K]:
    terms = tuple(new if i == at else term for i, term in enumerate(model.terms))
    widths = tuple(groups.width(new) if i == at else width for i, width in enumerate(model.widths))
    return replace(model, terms=terms, widths=widths)
