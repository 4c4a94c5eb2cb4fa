"""Evidence for groups of displacements, with the geometry marginalised: linear Gaussian models in closed form.

y ~ N(0, I + B B' + sum_g s_g^2 E_g E_g'), where y is the whitened residual, B the whitened derivative by the geometry in
units of the tolerances, E_g the whitened displacements of a group for coefficients of typical size, and s_g the group's
scale.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigh, solve_triangular
from scipy.linalg.lapack import dpotri

from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.typing import Floats

K = TypeVar("K", bound=Hashable)
"""Type of a group's key."""
SCALES = np.exp(np.linspace(np.log(0.05), np.log(40.0), 24))
"""Scales that are tried, with equal ratios."""


class Marginal:
    """The geometry, marginalised out of inner products."""

    def __init__(self, B: Floats) -> None:
        """Take the (m, p) whitened derivative by the geometry, in units of the tolerances."""
        self.B = B
        self._factor = cho_factor(np.eye(B.shape[1]) + B.T @ B, lower=True)
        self.absorbed = np.asarray(solve_triangular(self._factor[0], B.T, lower=True)).T
        """(m, p) B L'^-1 with L L' = I + B'B."""
        self.half_log_det = float(np.log(np.diag(self._factor[0])).sum())
        """ln det(I + B B') / 2."""

    def half(self, X: Floats) -> Floats:
        """(p, c) L^-1 B'X with L L' = I + B'B: the sums of its squares are the energy of X (m, c) that the geometry absorbs."""
        return np.asarray(self.absorbed.T @ X)

    def product(self, X: Floats, Z: Floats) -> Floats:
        """X' (I + B B')^-1 Z."""
        return np.asarray(X.T @ Z - self.half(X).T @ self.half(Z))

    def past(self, X: Floats) -> Floats:
        """(m, c) (I + B B')^-1 X: what the geometry does not absorb of X (m, c)."""
        return np.asarray(X - self.B @ cho_solve(self._factor, self.B.T @ X))

    def deviation(self, residual: Floats) -> Floats:
        """(p,) deviation of the geometry that explains a residual (m,) best, in units of the tolerances."""
        return np.asarray(cho_solve(self._factor, self.B.T @ residual))


class Groups(Generic[K]):
    """Groups of displacements by key, and their inner products X' (I + B B')^-1 Z, each computed once.

    A group's displacements never change, so a `Posterior` stays valid when groups are added. A group can consist of several
    others side by side, with one scale for all.
    """

    def __init__(self, marginal: Marginal, y: Floats, priors: Priors = PRIORS) -> None:
        """Start without a group, for a whitened residual y (m,)."""
        self.marginal, self.y, self.priors = marginal, y, priors
        self.core: dict[K, tuple[int, ...]] = {}
        self._columns: dict[K, Floats] = {}
        self._parts: dict[K, tuple[K, ...]] = {}
        self._half: dict[K, Floats] = {}
        self._moment: dict[K, Floats] = {}
        self._block: dict[tuple[K, K], Floats] = {}
        self._together: tuple[tuple[K, ...], Floats, Floats] = (), np.zeros((0, 0)), np.zeros((0, 0))
        self._half_y = marginal.half(y[:, None])[:, 0]
        self.power = float(y @ y - self._half_y @ self._half_y)

    @property
    def log_evidence(self) -> float:
        """Log marginal likelihood of y without a group, but for a constant: -[y' (I + B B')^-1 y + ln det(I + B B')] / 2."""
        return -0.5 * self.power - self.marginal.half_log_det

    def add(self, term: K, columns: Floats, core: tuple[int, ...] = ()) -> None:
        """Add a group of whitened displacements (m, c); ``core`` as in :func:`best_scales`.

        Raises `ValueError` if there already is a group with this key.
        """
        self._new(term, tuple(i for i in core if i < columns.shape[1]))
        self._columns[term] = columns
        self._half[term] = self.marginal.half(columns)
        self._moment[term] = columns.T @ self.y - self._half[term].T @ self._half_y

    def join(self, term: K, parts: Sequence[K]) -> None:
        """Add a group that consists of several groups side by side; its core consists of their cores.

        Raises `ValueError` if there already is a group with this key.
        """
        ends = np.cumsum([0, *(self.width(part) for part in parts)])
        self._new(term, tuple(int(end) + i for part, end in zip(parts, ends, strict=False) for i in self.core[part]))
        self._parts[term] = tuple(parts)

    def _new(self, term: K, core: tuple[int, ...]) -> None:
        if term in self.core:
            raise ValueError(f"{term} is there already")
        self.core[term] = core

    def __contains__(self, term: object) -> bool:
        """Whether there is a group with this key."""
        return term in self.core

    def parts(self, term: K) -> tuple[K, ...]:
        """The groups that a group consists of; the group itself where it is not joined from several."""
        return self._parts.get(term, (term,))

    def columns(self, term: K) -> Floats:
        """(m, c) whitened displacements of a group."""
        parts = self.parts(term)
        return self._columns[term] if parts == (term,) else np.hstack([self._columns[part] for part in parts])

    def half(self, term: K) -> Floats:
        """(p, c) what the geometry absorbs of a group: :meth:`Marginal.half`."""
        parts = self.parts(term)
        return self._half[term] if parts == (term,) else np.hstack([self._half[part] for part in parts])

    def width(self, term: K) -> int:
        """Number of a group's coefficients."""
        return sum(self._columns[part].shape[1] for part in self.parts(term))

    def moment(self, term: K) -> Floats:
        """(c,) inner products of a group with the residual."""
        parts = self.parts(term)
        return self._moment[term] if parts == (term,) else np.concatenate([self._moment[part] for part in parts])

    def block(self, a: K, b: K) -> Floats:
        """(c_a, c_b) inner products of two groups."""
        if (a, b) not in self._block:
            if a in self._parts or b in self._parts:
                rows = [np.hstack([self.block(one, other) for other in self.parts(b)]) for one in self.parts(a)]
                found = np.vstack(rows)  # np.block takes several times as long
            else:
                found = self._columns[a].T @ self._columns[b] - self._half[a].T @ self._half[b]
            self._block[a, b], self._block[b, a] = found, found.T
        return self._block[a, b]

    def _beside(self, parts: Sequence[K]) -> tuple[Floats, Floats]:
        """Columns of some groups, none of them joined, and what the geometry absorbs of them."""
        return np.hstack([self._columns[part] for part in parts]), np.hstack([self._half[part] for part in parts])

    def across(self, term: K, others: Sequence[K]) -> Floats:
        """(c, m) inner products of a group with several others, m columns in all."""
        parts = [part for other in others for part in self.parts(other)]
        mine = [one for one in self.parts(term) if any((one, part) not in self._block for part in parts)]
        new = tuple(part for part in parts if any((one, part) not in self._block for one in mine))
        if len(new) > 1:  # one product for all: it reads the columns once
            if self._together[0] != new:
                self._together = (new, *self._beside(new))
            columns, half = self._beside(mine)
            found = columns.T @ self._together[1] - half.T @ self._together[2]
            ends, tops = (np.cumsum([self.width(part) for part in some])[:-1] for some in (new, mine))
            for one, rows in zip(mine, np.split(found, tops), strict=True):
                for part, block in zip(new, np.split(rows, ends, axis=1), strict=True):
                    self._block[one, part], self._block[part, one] = block, block.T
        return np.hstack([np.zeros((self.width(term), 0)), *(self.block(term, other) for other in others)])


def best_scales(
    grams: Floats, moments: Floats, core: Sequence[int] = (), priors: Priors = PRIORS
) -> tuple[Floats, Floats]:
    """(S,) largest gains in log evidence over the scales, and these scales, for S groups of c columns.

    With the eigenvalues lambda_j of a group's inner products, and its components a_j along the eigenvectors,

        gain(s) = sum over j of [s^2 a_j^2 / (1 + s^2 lambda_j) - ln(1 + s^2 lambda_j)] / 2 - (ln s / scale_spread)^2 / 2.

    A scale is admitted only where the coefficients of the group's core have a root mean square of at least
    ``priors.least_core`` times the scale (core and modulation in the glossary). Where the data determine the core to better
    than its typical size, it must also have at least the square of this share of the energy of the whole, to within the noise
    of its coefficients: where a load hardly varies, a compliance whose hysteresis is all that shows is a backlash.

    ``grams``, ``moments``: (S, c, c) inner products of each group with itself and (S, c) with the residual, the rest of the
    model marginalised. ``core``: indices of the core's columns; empty where all columns are the core.
    """
    values, vectors = np.linalg.eigh(grams)
    values = np.maximum(values, 0.0)[:, :, None]
    along = vectors.swapaxes(1, 2) @ moments[:, :, None]
    s2 = SCALES**2
    shrunk = s2 / (1.0 + s2 * values)
    fitted = shrunk * along
    gain = 0.5 * (fitted * along - np.log1p(s2 * values)).sum(axis=1)
    gain -= 0.5 * (np.log(SCALES) / priors.scale_spread) ** 2
    own = [i for i in core if i < values.shape[1]]
    if own:
        part = vectors[:, own]
        mean, variance = part @ fitted, part**2 @ shrunk
        unsuited = ((mean**2 + variance) / s2).mean(axis=1) < priors.least_core**2
        whole = (values * fitted**2).sum(axis=1)
        inner = grams[:, own][:, :, own]
        energy = (mean * (inner @ mean)).sum(axis=1)
        seen = np.trace(inner, axis1=1, axis2=2)[:, None] > len(own)
        unsuited |= seen & (energy + len(own) < priors.least_core**2 * whole)
        unsuited[:, 0] = False  # the smallest scale is always admitted, so that there is a gain
        gain = np.where(unsuited, -np.inf, gain)
    best = np.argmax(gain, axis=1)
    return gain[np.arange(len(gain)), best], SCALES[best]


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
    """The model of some groups with given scales: with M = S G S and b = S g,

        ln Lambda = b' (1 + M)^-1 b / 2 - ln det(1 + M) / 2 + log prior of the scales,

    where G has the inner products of all columns, g those with the residual, and S is the diagonal matrix of the scales. The
    posterior of the coefficients has the covariance C = S (1 + M)^-1 S and the mean C g.
    """
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


def marginal_power(groups: Groups[K], model: Posterior[K]) -> float:
    """Chi-square of the residual with geometry and a model marginalised: y' (I + B B' + sum_k s_k^2 E_k E_k')^-1 y."""
    moment = np.concatenate([np.zeros(0), *(groups.moment(term) for term in model.terms)])
    return groups.power - float(moment @ model.mean)


def shares(groups: Groups[K], model: Posterior[K]) -> dict[K, float]:
    """Squares of each term's displacements beyond what the geometry absorbs, over the sum of those of all terms.

    Terms that can take each other's place have such shares too, while the gap without one of them is hardly larger.
    """
    parts = np.split(model.mean, np.cumsum(model.widths)[:-1])
    squares = [float(c @ groups.block(t, t) @ c) for t, c in zip(model.terms, parts, strict=True)]
    return {term: one / max(sum(squares), 1e-300) for term, one in zip(model.terms, squares, strict=True)}


def given(groups: Groups[K], model: Posterior[K], term: K) -> tuple[Floats, Floats]:
    """(c, c) inner products of a group k with itself and (c,) with the residual, geometry and a model marginalised:

    G_kk - G_km C G_mk and g_k - G_km c, with the model's covariance C and mean c.
    """
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
    start, count, same = model.scale, len(model.terms), 0
    for i in range(sweeps * count):
        before = model.scale
        model = _rescaled(groups, model, i % count)
        same = same + 1 if model.scale == before else 1  # terms whose scales are the best ones given the others
        if same == count:
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
    rest = C[~out]
    across = cho_solve(own, rest[:, out].T)
    ratio = -0.5 * float(mean[out] @ cho_solve(own, mean[out])) - float(np.log(np.diag(own[0])).sum())
    return replace(
        model,
        log_evidence=model.log_evidence + ratio + int(out.sum()) * float(np.log(scale)),
        mean=mean[~out] - across.T @ mean[out],
        covariance=rest[:, ~out] - rest[:, out] @ across,
    )


def without_coefficients(model: Posterior[Any], own: slice, scale: float) -> float:
    """Gain in log evidence if some coefficients of a group of scale ``scale`` are zero."""
    C, mean = model.covariance[own, own], model.mean[own]
    return float(len(mean) * np.log(scale) - 0.5 * mean @ np.linalg.solve(C, mean) - 0.5 * np.linalg.slogdet(C)[1])


def _more(groups: Groups[K], model: Posterior[K], old: K, new: K) -> Posterior[K]:
    """More parts, appended to the present ones: the posterior by one step of Gaussian elimination."""
    at = model.terms.index(old)
    added = groups.parts(new)[len(groups.parts(old)) :]
    parts = [part for term in model.terms for part in groups.parts(term)]
    # Few columns: side by side, the columns of the model would take longer than all products.
    A = np.vstack([np.hstack([groups.block(part, other) for other in parts]) for part in added])
    gram = np.block([[groups.block(one, other) for other in added] for one in added]) - A @ model.covariance @ A.T
    moment = np.concatenate([groups.moment(part) for part in added]) - A @ model.mean
    scale, count = model.scale[at], len(moment)
    factor = cho_factor(np.eye(count) / scale**2 + gram, lower=True)
    mean = cho_solve(factor, moment)
    moved = model.covariance @ A.T
    across = -cho_solve(factor, moved.T).T
    n, end = len(model.mean), sum(model.widths[: at + 1])
    covariance = np.empty((n + count, n + count))
    own, others = slice(end, end + count), ((slice(end), slice(end)), (slice(end, n), slice(end + count, n + count)))
    wider, shifted = model.covariance - across @ moved.T, model.mean - moved @ mean
    for a, to_a in others:
        for b, to_b in others:
            covariance[to_a, to_b] = wider[a, b]
        covariance[to_a, own], covariance[own, to_a] = across[a], across[a].T
    covariance[own, own] = cho_solve(factor, np.eye(count))
    gain = 0.5 * float(moment @ mean) - float(np.log(scale * np.diag(factor[0])).sum())
    return replace(
        _named(groups, model, at, new),
        log_evidence=model.log_evidence + gain,
        mean=np.concatenate([shifted[:end], mean, shifted[end:]]),
        covariance=covariance,
    )


def _named(groups: Groups[K], model: Posterior[K], at: int, new: K) -> Posterior[K]:
    terms = tuple(new if i == at else term for i, term in enumerate(model.terms))
    widths = tuple(groups.width(new) if i == at else width for i, width in enumerate(model.widths))
    return replace(model, terms=terms, widths=widths)
