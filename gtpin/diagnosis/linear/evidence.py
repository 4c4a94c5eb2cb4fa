"""Evidence for groups of displacements, with the geometry marginalised: linear Gaussian models in closed form.

y ~ N(0, I + B B' + sum_g s_g^2 E_g E_g'), where y is the whitened residual, B the whitened derivative by the geometry in
units of the tolerances, E_g the whitened displacements of a group for coefficients of typical size, and s_g the group's
scale.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Generic, TypeVar

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

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

    def half(self, X: Floats) -> Floats:
        """(p, c) L^-1 B'X with L L' = I + B'B: the sums of its squares are the energy of X (m, c) that the geometry absorbs."""
        return self.lower_solve(self.B.T @ X)

    def lower_solve(self, BtX: Floats) -> Floats:
        """(p, c) L^-1 times B'X (p, c), with L L' = I + B'B."""
        return np.asarray(solve_triangular(self._factor[0], BtX, lower=True))

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
        self._half_y = marginal.half(y[:, None])[:, 0]
        self.power = float(y @ y - self._half_y @ self._half_y)

    def add(self, term: K, columns: Floats, core: tuple[int, ...] = ()) -> None:
        """Add a group of whitened displacements (m, c); ``core`` as in :func:`best_scales`.

        Raises `ValueError` if there already is a group with this key.
        """
        self._new(term, core)
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
        return np.hstack([self._half[part] for part in self.parts(term)])

    def width(self, term: K) -> int:
        """Number of a group's coefficients."""
        return sum(self._columns[part].shape[1] for part in self.parts(term))

    def moment(self, term: K) -> Floats:
        """(c,) inner products of a group with the residual."""
        return np.concatenate([self._moment[part] for part in self.parts(term)])

    def block(self, a: K, b: K) -> Floats:
        """(c_a, c_b) inner products of two groups."""
        if (a, b) not in self._block:
            if a in self._parts or b in self._parts:
                found = np.block([[self.block(one, other) for other in self.parts(b)] for one in self.parts(a)])
            else:
                found = self._columns[a].T @ self._columns[b] - self._half[a].T @ self._half[b]
            self._block[a, b], self._block[b, a] = found, found.T
        return self._block[a, b]

    def across(self, term: K, others: Sequence[K]) -> Floats:
        """(c, m) inner products of a group with several others, m columns in all."""
        return np.hstack([np.zeros((self.width(term), 0)), *(self.block(term, other) for other in others)])


def best_scales(
    grams: Floats, moments: Floats, core: Sequence[int] = (), priors: Priors = PRIORS
) -> tuple[Floats, Floats]:
    """(S,) largest gains in log evidence over the scales, and these scales, for S groups of c columns.

    A scale is admitted only where the coefficients of the group's core have a root mean square of at least
    ``priors.least_core`` times the scale (core and modulation in the glossary). Where the data determine the core to better
    than its typical size, it must also have at least the square of this share of the energy of the whole, to within the noise
    of its coefficients: where a load hardly varies, a compliance whose hysteresis is all that shows is a backlash.

    ``grams``, ``moments``: (S, c, c) inner products of each group with itself and (S, c) with the residual, the rest of the
    model marginalised. ``core``: indices of the core's columns; empty where all columns are the core.
    """
    values, vectors = np.linalg.eigh(grams)
    values = np.maximum(values, 0.0)
    along = (vectors.swapaxes(1, 2) @ moments[..., None])[..., 0]
    s2 = (SCALES**2)[:, None, None]
    shrunk = s2 / (1.0 + s2 * values)
    gain = 0.5 * (shrunk * along**2 - np.log1p(s2 * values)).sum(axis=2)
    gain -= 0.5 * (np.log(SCALES)[:, None] / priors.scale_spread) ** 2
    own = [i for i in core if i < values.shape[1]]
    if own:
        part = vectors[:, own]
        mean = np.einsum("sfj,ksj->ksf", part, shrunk * along, optimize=True)
        variance = np.einsum("sfj,ksj->ksf", part**2, shrunk, optimize=True)
        unsuited = ((mean**2 + variance) / s2).mean(axis=2) < priors.least_core**2
        whole = (values * (shrunk * along) ** 2).sum(axis=2)
        inner = grams[:, own][:, :, own]
        energy = np.einsum("ksf,sfg,ksg->ks", mean, inner, mean, optimize=True)
        seen = np.trace(inner, axis1=1, axis2=2) > len(own)
        unsuited |= seen & (energy + len(own) < priors.least_core**2 * whole)
        unsuited[0] = False  # the smallest scale is always admitted, so that there is a gain
        gain = np.where(unsuited, -np.inf, gain)
    best = np.argmax(gain, axis=0)
    return np.take_along_axis(gain, best[None], axis=0)[0], SCALES[best]


def gains_of_draws(
    values: Floats, vectors: Floats, along: Floats, core: Sequence[int] = (), priors: Priors = PRIORS
) -> Floats:
    """(S,) largest gain in log evidence of one group over the scales, as :func:`best_scales`, for S residuals.

    ``values``, ``vectors``: (c,) eigenvalues and (c, c) eigenvectors of the group's inner products. ``along``: (S, c) inner
    products of the group with each residual, along the eigenvectors.
    """
    s2 = (SCALES**2)[:, None]
    shrunk = s2 / (1.0 + s2 * values)
    gain = 0.5 * (shrunk @ (along**2).T - np.log1p(s2 * values).sum(axis=1)[:, None])
    gain -= 0.5 * (np.log(SCALES)[:, None] / priors.scale_spread) ** 2
    if len(core):
        part = vectors[list(core)]
        mean = (shrunk[:, None] * part).reshape(-1, len(values)) @ along.T
        variance = (shrunk @ (part**2).T).mean(axis=1)
        mean = mean.reshape(len(SCALES), len(part), -1)
        square = ((mean**2).mean(axis=1) + variance[:, None]) / s2
        inner = (part * values) @ part.T
        energy = np.einsum("kfs,fg,kgs->ks", mean, inner, mean, optimize=True)
        unsuited = square < priors.least_core**2
        if np.trace(inner) > len(part):
            unsuited |= energy + len(part) < priors.least_core**2 * ((shrunk**2 * values) @ (along**2).T)
        unsuited[0] = False  # as in `best_scales`
        gain = np.where(unsuited, -np.inf, gain)
    return np.asarray(gain.max(axis=0))
