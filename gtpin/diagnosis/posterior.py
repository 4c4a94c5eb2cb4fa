"""The posterior of some groups of displacements together, and the gain by one more group."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigh
from scipy.linalg.lapack import dpotri

from gtpin.diagnosis.evidence import Groups, best_scales
from gtpin.typing import Floats

K = TypeVar("K", bound=Hashable)
"""Type of a group's key."""
T = TypeVar("T")


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


def exchanged(groups: Groups[K], model: Posterior[K], old: K, new: K) -> Posterior[K]:
    """The model with one group in the place of another, at the same scales.

    ``old``, ``new``: the group that is removed, and the one that takes its place; both are in ``groups``.
    """
    before, after = groups.parts(old), groups.parts(new)
    if len(after) < len(before) and after == tuple(part for part in before if part in after):
        return _less(groups, model, old, new)
    if len(after) > len(before) and after[: len(before)] == before:
        try:
            return _more(groups, model, old, new)
        except LinAlgError:  # caused by rounding errors of many changes: the model is computed again
            pass
    return fixed(groups, tuple(new if term == old else term for term in model.terms), model.scale)


def without(groups: Groups[K], model: Posterior[K], term: K, sweeps: int = 0) -> Posterior[K]:
    """A model without one of its groups. Its scales are estimated again by ``sweeps`` steps of coordinate ascent; 0: not."""
    if model.terms == (term,):
        return NOTHING
    at = model.terms.index(term)
    place = sum(model.widths[:at])
    out = np.zeros(len(model.mean), dtype=bool)
    out[place : place + model.widths[at]] = True
    prior = scale_prior(groups, model.scale[at])
    less = _zero(groups, model, out, model.scale[at])
    less = replace(
        less,
        terms=_but(model.terms, at),
        widths=_but(model.widths, at),
        scale=_but(model.scale, at),
        log_evidence=less.log_evidence - prior,
    )
    return _tuned(groups, less, sweeps) if sweeps else less


def tuned(groups: Groups[K], terms: Sequence[K], scale: Sequence[float], sweeps: int = 2) -> Posterior[K]:
    """The model of some groups with the scales of largest evidence, by coordinate ascent from given ones."""
    return _tuned(groups, fixed(groups, terms, scale), sweeps)


def _tuned(groups: Groups[K], model: Posterior[K], sweeps: int) -> Posterior[K]:
    start = model.scale
    for _ in range(sweeps if len(model.terms) > 1 else len(model.terms)):
        before = model.scale
        for i in range(len(model.terms)):
            model = _rescaled(groups, model, i)
        if model.scale == before:
            break
    return model if model.scale == start else fixed(groups, model.terms, model.scale)


def _rescaled(groups: Groups[K], model: Posterior[K], at: int) -> Posterior[K]:
    """The model with the best scale of one of its groups, the other scales unchanged.

    The precision of a group's coefficients, less that of their prior, is their inner product given the other groups.
    """
    place, scale = sum(model.widths[:at]), model.scale[at]
    own = slice(place, place + model.widths[at])
    identity = np.eye(model.widths[at])
    model, factor = _factored(groups, model, own)
    C, mean = model.covariance, model.mean
    precision = cho_solve(factor, identity)
    gram, moment = precision - identity / scale**2, precision @ mean[own]
    gram = 0.5 * (gram + gram.T)
    _, best = best_scales(gram[None], moment[None], groups.core[model.terms[at]], groups.priors)
    if (new := float(best[0])) == scale:
        return model
    # The prior's precision changes by `more`: Woodbury's identity for the columns of this group.
    more = 1.0 / new**2 - 1.0 / scale**2
    inner = np.linalg.solve(identity + more * C[own, own], more * C[own])
    scales = tuple(new if i == at else s for i, s in enumerate(model.scale))
    return replace(model, scale=scales, mean=mean - inner.T @ mean[own], covariance=C - C[:, own] @ inner)


def _but(values: tuple[T, ...], at: int) -> tuple[T, ...]:
    return (*values[:at], *values[at + 1 :])


def _less(groups: Groups[K], model: Posterior[K], old: K, new: K) -> Posterior[K]:
    """Fewer parts: the posterior given that the coefficients of the removed parts are zero (Savage-Dickey density ratio)."""
    at = model.terms.index(old)
    place, left = sum(model.widths[:at]), set(groups.parts(new))
    out = np.zeros(len(model.mean), dtype=bool)
    for part in groups.parts(old):
        width = groups.width(part)
        out[place : place + width] = part not in left
        place += width
    less = _zero(groups, model, out, model.scale[at])
    return _named(groups, less, at, new)


def _factored(
    groups: Groups[K], model: Posterior[K], own: slice | npt.NDArray[np.bool_]
) -> tuple[Posterior[K], tuple[Floats, bool]]:
    """A model, and the Cholesky factor of a block of its covariance.

    Where rounding errors of many changes have made the block indefinite, the model is computed again from its groups.
    """
    try:
        return model, cho_factor(model.covariance[own][:, own], lower=True)
    except LinAlgError:
        model = fixed(groups, model.terms, model.scale)
        return model, cho_factor(model.covariance[own][:, own], lower=True)


def _zero(groups: Groups[K], model: Posterior[K], out: npt.NDArray[np.bool_], scale: float) -> Posterior[K]:
    """The model given that the coefficients of the mask ``out`` (n,), of scale ``scale``, are zero. Its terms are unchanged."""
    model, own = _factored(groups, model, out)
    C, mean = model.covariance, model.mean
    across = cho_solve(own, C[np.ix_(out, ~out)])
    ratio = -0.5 * float(mean[out] @ cho_solve(own, mean[out])) - float(np.log(np.diag(own[0])).sum())
    return replace(
        model,
        log_evidence=model.log_evidence + ratio + int(out.sum()) * float(np.log(scale)),
        mean=mean[~out] - across.T @ mean[out],
        covariance=C[np.ix_(~out, ~out)] - C[np.ix_(~out, out)] @ across,
    )


def _more(groups: Groups[K], model: Posterior[K], old: K, new: K) -> Posterior[K]:
    """More parts, appended to the present ones: the posterior by one step of Gaussian elimination."""
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
