"""Evidence for groups of displacements, with the geometry marginalised: linear Gaussian models in closed form.

y ~ N(0, I + B B' + sum_g s_g^2 E_g E_g'), where y is the whitened residual, B the whitened derivative by the geometry in
tolerances, E_g the whitened displacements of a group for coefficients of typical size, and s_g the group's scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, solve_triangular

Floats = npt.NDArray[np.float64]

SCALES = np.exp(np.linspace(np.log(0.05), np.log(40.0), 24))
"""Scales that are tried, over the typical size."""
SCALE_SPREAD = 1.3
"""Spread of the scales' logarithm about zero: the prior on how far an effect is from its typical size."""


@dataclass(frozen=True)
class Products:
    """Inner products of displacements and residual, with the geometry marginalised: X' (I + B B')^-1 Z.

    Parameters
    ----------
    gram
        (M, M) of the displacements of all groups with each other.
    moment
        (M,) of the displacements with the residual.
    power
        The residual's with itself.
    groups
        By name, where a group's columns are.
    """

    gram: Floats
    moment: Floats
    power: float
    groups: dict[str, slice]

    def extended(self, marginal: Marginal, y: Floats, columns: dict[str, Floats], name: str) -> Products:
        """The same products with one group's displacements taken anew from ``columns``, or added."""
        new = columns[name]
        others = [n for n in self.groups if n != name]
        keep = self.columns(others)
        order = np.hstack([columns[n] for n in others]) if others else np.zeros((len(y), 0))
        across = marginal.product(order, new)
        gram = np.block([[self.gram[np.ix_(keep, keep)], across], [across.T, marginal.product(new, new)]])
        moment = np.concatenate([self.moment[keep], marginal.product(new, y[:, None])[:, 0]])
        ends = np.cumsum([0] + [columns[n].shape[1] for n in (*others, name)])
        places = {n: slice(int(a), int(b)) for n, a, b in zip((*others, name), ends[:-1], ends[1:], strict=True)}
        return Products(gram, moment, self.power, places)

    def columns(self, names: Sequence[str]) -> npt.NDArray[np.int_]:
        """Columns of some groups."""
        return np.concatenate(
            [np.arange(self.groups[n].start, self.groups[n].stop) for n in names] or [np.zeros(0, int)]
        )


class Marginal:
    """The geometry, marginalised out of inner products."""

    def __init__(self, B: Floats) -> None:
        """Take the (m, p) whitened derivative by the geometry, in tolerances."""
        self.B = B
        self._factor = cho_factor(np.eye(B.shape[1]) + B.T @ B, lower=True)

    def half(self, X: Floats) -> Floats:
        """(p, c) L^-1 B'X, whose squares are what the geometry absorbs of X (m, c)."""
        return self.lower_solve(self.B.T @ X)

    def lower_solve(self, BtX: Floats) -> Floats:
        """(p, c) L^-1 times B'X (p, c)."""
        return np.asarray(solve_triangular(self._factor[0], BtX, lower=True))

    def product(self, X: Floats, Z: Floats) -> Floats:
        """X' (I + B B')^-1 Z."""
        return np.asarray(X.T @ Z - self.half(X).T @ self.half(Z))

    def products(self, y: Floats, groups: dict[str, Floats]) -> Products:
        """Inner products of a residual (m,) and the displacements (m, c) of groups."""
        E = np.hstack(list(groups.values())) if groups else np.zeros((len(y), 0))
        ends = np.cumsum([0] + [g.shape[1] for g in groups.values()])
        places = {name: slice(int(a), int(b)) for name, a, b in zip(groups, ends[:-1], ends[1:], strict=True)}
        hE, hy = self.half(E), self.half(y[:, None])[:, 0]
        return Products(E.T @ E - hE.T @ hE, E.T @ y - hE.T @ hy, float(y @ y - hy @ hy), places)

    def deviation(self, residual: Floats) -> Floats:
        """(p,) geometry that explains a residual best, in tolerances."""
        return np.asarray(cho_solve(self._factor, self.B.T @ residual))


@dataclass(frozen=True)
class Posterior:
    """A model of some groups.

    Parameters
    ----------
    names
        The groups.
    scale
        Of each, over the typical size.
    log_evidence
        Natural log of its evidence over that of no group, with the scales' priors.
    mean, covariance
        Of the coefficients of all groups, over their typical sizes.
    """

    names: tuple[str, ...]
    scale: tuple[float, ...]
    log_evidence: float
    mean: Floats
    covariance: Floats


def fixed(products: Products, names: Sequence[str], scale: Sequence[float]) -> Posterior:
    """The model of some groups with given scales."""
    columns = products.columns(names)
    sizes = np.concatenate(
        [np.full(products.groups[n].stop - products.groups[n].start, s) for n, s in zip(names, scale, strict=True)]
        or [np.zeros(0)]
    )
    M = products.gram[np.ix_(columns, columns)] * np.outer(sizes, sizes)
    u = products.moment[columns] * sizes
    factor = cho_factor(np.eye(len(u)) + M, lower=True)
    w = cho_solve(factor, u)
    prior = -0.5 * sum((np.log(s) / SCALE_SPREAD) ** 2 for s in scale)
    log_evidence = 0.5 * float(u @ w) - float(np.log(np.diag(factor[0])).sum()) + prior
    covariance = cho_solve(factor, np.eye(len(u))) * np.outer(sizes, sizes)
    return Posterior(tuple(names), tuple(scale), log_evidence, w * sizes, covariance)


@dataclass(frozen=True)
class Conditional:
    """Inner products with the geometry and a model's groups marginalised: what is new beside the model."""

    products: Products
    model: Posterior

    @staticmethod
    def on(products: Products, model: Posterior) -> Conditional:
        """Condition all groups on a model."""
        columns = products.columns(model.names)
        if not columns.size:
            return Conditional(products, model)
        across = products.gram[:, columns]
        gram = products.gram - across @ model.covariance @ across.T
        moment = products.moment - across @ model.mean
        power = products.power - float(products.moment[columns] @ model.mean)
        return Conditional(Products(gram, moment, power, products.groups), model)

    def single(self, name: str) -> tuple[float, float]:
        """Best gain in log evidence by adding one group, and its scale."""
        g = self.products.groups[name]
        values, vectors = np.linalg.eigh(self.products.gram[g, g])
        u2 = (vectors.T @ self.products.moment[g]) ** 2
        gain, scale = best_scales(np.maximum(values, 0.0)[None], u2[None])
        return float(gain[0]), float(scale[0])


def best_scales(eigenvalues: Floats, squares: Floats) -> tuple[Floats, Floats]:
    """(S,) largest log evidence over the scales, and the scales, of S groups of c columns.

    Parameters
    ----------
    eigenvalues, squares
        (S, c) of the groups' Gram matrices, and squared moments along their eigenvectors.
    """
    s2 = (SCALES**2)[:, None, None]
    gain = 0.5 * (s2 * squares / (1.0 + s2 * eigenvalues) - np.log1p(s2 * eigenvalues)).sum(axis=2)
    gain -= 0.5 * (np.log(SCALES)[:, None] / SCALE_SPREAD) ** 2
    best = np.argmax(gain, axis=0)
    return np.take_along_axis(gain, best[None], axis=0)[0], SCALES[best]


def tuned(products: Products, names: Sequence[str], scale: Sequence[float], sweeps: int = 2) -> Posterior:
    """The model of some groups with the scales that suit best, by coordinate ascent."""
    scales = list(scale)
    if len(names) == 1:
        _, scales[0] = Conditional(products, fixed(products, (), ())).single(names[0])
        return fixed(products, names, scales)
    for _ in range(sweeps):
        for i, name in enumerate(names):
            others = [n for n in names if n != name]
            kept = [s for n, s in zip(names, scales, strict=True) if n != name]
            _, scales[i] = Conditional.on(products, fixed(products, others, kept)).single(name)
    return fixed(products, names, scales)
