"""Evidence for groups of displacements, with the geometry marginalised: linear Gaussian models in closed form.

y ~ N(0, I + B B' + sum_g s_g^2 E_g E_g'), where y is the whitened residual, B the whitened derivative by the geometry in
tolerances, E_g the whitened displacements of a group for coefficients of typical size, and s_g the group's scale.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, solve_triangular

Floats = npt.NDArray[np.float64]

SCALES = np.exp(np.linspace(np.log(0.05), np.log(40.0), 24))
"""Scales that are tried, over the typical size."""
SCALE_SPREAD = 1.3
"""Spread of the scales' logarithm about zero: the prior on how far an effect is from its typical size."""

LEAST_FORM = 0.5
"""Root mean square of the form's coefficients over the scale, below which a scale does not suit a group."""


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

    def deviation(self, residual: Floats) -> Floats:
        """(p,) geometry that explains a residual best, in tolerances."""
        return np.asarray(cho_solve(self._factor, self.B.T @ residual))


class Groups:
    """Groups of displacements by name, and their inner products X' (I + B B')^-1 Z, each computed once."""

    def __init__(self, marginal: Marginal, y: Floats) -> None:
        """Start without a group, for a whitened residual y (m,)."""
        self.marginal, self.y = marginal, y
        self.columns: dict[str, Floats] = {}
        self.form: dict[str, tuple[int, ...]] = {}
        self._half: dict[str, Floats] = {}
        self._moment: dict[str, Floats] = {}
        self._block: dict[tuple[str, str], Floats] = {}
        self._half_y = marginal.half(y[:, None])[:, 0]
        self.power = float(y @ y - self._half_y @ self._half_y)

    def set(self, name: str, columns: Floats, form: tuple[int, ...] = ()) -> None:
        """Add a group of whitened displacements (m, c), or give it others; ``form`` as in :func:`best_scales`."""
        self.form[name] = form
        self._block = {pair: block for pair, block in self._block.items() if name not in pair}
        self.columns[name] = columns
        self._half[name] = self.marginal.half(columns)
        self._moment[name] = columns.T @ self.y - self._half[name].T @ self._half_y

    def moment(self, name: str) -> Floats:
        """(c,) of a group with the residual."""
        return self._moment[name]

    def block(self, a: str, b: str) -> Floats:
        """(c_a, c_b) of two groups."""
        if (a, b) not in self._block:
            found = self.columns[a].T @ self.columns[b] - self._half[a].T @ self._half[b]
            self._block[a, b], self._block[b, a] = found, found.T
        return self._block[a, b]

    def across(self, name: str, others: Sequence[str]) -> Floats:
        """(c, sum of the others') of a group with several."""
        width = self.columns[name].shape[1]
        return np.hstack([np.zeros((width, 0)), *(self.block(name, other) for other in others)])


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


NOTHING = Posterior((), (), 0.0, np.zeros(0), np.zeros((0, 0)))
"""The model without a group."""


def fixed(groups: Groups, names: Sequence[str], scale: Sequence[float]) -> Posterior:
    """The model of some groups with given scales."""
    if not names:
        return NOTHING
    widths = [groups.columns[n].shape[1] for n in names]
    sizes = np.repeat(np.asarray(scale, dtype=float), widths)
    M = np.vstack([groups.across(n, names) for n in names]) * np.outer(sizes, sizes)
    u = np.concatenate([groups.moment(n) for n in names]) * sizes
    factor = cho_factor(np.eye(len(u)) + M, lower=True)
    w = cho_solve(factor, u)
    prior = -0.5 * sum((np.log(s) / SCALE_SPREAD) ** 2 for s in scale)
    log_evidence = 0.5 * float(u @ w) - float(np.log(np.diag(factor[0])).sum()) + prior
    covariance = cho_solve(factor, np.eye(len(u))) * np.outer(sizes, sizes)
    return Posterior(tuple(names), tuple(scale), log_evidence, w * sizes, covariance)


def beside(groups: Groups, model: Posterior, name: str) -> tuple[Floats, Floats]:
    """(c, c) inner products of a group with itself and (c,) with the residual, geometry and a model marginalised."""
    across = groups.across(name, model.names)
    gram = groups.block(name, name) - across @ model.covariance @ across.T
    return gram, groups.moment(name) - across @ model.mean


def gain(groups: Groups, model: Posterior, name: str) -> tuple[float, float]:
    """Largest gain in log evidence by adding a group to a model, and the scale that gives it."""
    return all_gains(groups, model, (name,))[name]


def all_gains(groups: Groups, model: Posterior, names: Iterable[str]) -> dict[str, tuple[float, float]]:
    """The same for each of several groups."""
    alike: dict[tuple[int, tuple[int, ...]], list[str]] = defaultdict(list)
    for name in names:
        width = groups.columns[name].shape[1]
        alike[1 << (width - 1).bit_length(), groups.form[name]].append(name)
    found: dict[str, tuple[float, float]] = {}
    for (width, form), members in alike.items():
        # Columns of zeros, which bring nothing, make groups of much the same width alike.
        grams, moments = np.zeros((len(members), width, width)), np.zeros((len(members), width))
        for i, name in enumerate(members):
            gram, moment = beside(groups, model, name)
            grams[i, : len(moment), : len(moment)], moments[i, : len(moment)] = gram, moment
        best = zip(*best_scales(grams, moments, form), strict=True)
        found |= {name: (float(g), float(s)) for name, (g, s) in zip(members, best, strict=True)}
    return found


def best_scales(grams: Floats, moments: Floats, form: Sequence[int] = ()) -> tuple[Floats, Floats]:
    """(S,) largest log evidence over the scales, and the scales, of S groups of c columns.

    A scale must suit the group's form: where the coefficients of its form are far smaller than the scale, the scale only
    serves what bends it, and there is no form left to bend.

    Parameters
    ----------
    grams, moments
        (S, c, c) and (S, c) of the groups, whatever else is in the model marginalised.
    form
        Columns that are the form; none where all are.
    """
    values, vectors = np.linalg.eigh(grams)
    values = np.maximum(values, 0.0)
    along = (vectors.swapaxes(1, 2) @ moments[..., None])[..., 0]
    s2 = (SCALES**2)[:, None, None]
    shrunk = s2 / (1.0 + s2 * values)
    gain = 0.5 * (shrunk * along**2 - np.log1p(s2 * values)).sum(axis=2)
    gain -= 0.5 * (np.log(SCALES)[:, None] / SCALE_SPREAD) ** 2
    own = [i for i in form if i < values.shape[1]]
    if own:
        part = vectors[:, own]
        mean = np.einsum("sfj,ksj->ksf", part, shrunk * along, optimize=True)
        variance = np.einsum("sfj,ksj->ksf", part**2, shrunk, optimize=True)
        unsuited = ((mean**2 + variance) / s2).mean(axis=2) < LEAST_FORM**2
        unsuited[0] = False
        gain = np.where(unsuited, -np.inf, gain)
    best = np.argmax(gain, axis=0)
    return np.take_along_axis(gain, best[None], axis=0)[0], SCALES[best]


def tuned(groups: Groups, names: Sequence[str], scale: Sequence[float], sweeps: int = 2) -> Posterior:
    """The model of some groups with the scales that suit best, by coordinate ascent."""
    scales = list(scale)
    for _ in range(sweeps if len(names) > 1 else len(names)):
        for i, name in enumerate(names):
            others = [n for n in names if n != name]
            kept = [s for n, s in zip(names, scales, strict=True) if n != name]
            _, scales[i] = gain(groups, fixed(groups, others, kept), name)
    return fixed(groups, names, scales)


def without(groups: Groups, model: Posterior, name: str, sweeps: int = 0) -> Posterior:
    """A model less one of its groups; its scales tuned again where ``sweeps`` is not 0."""
    kept = [(n, s) for n, s in zip(model.names, model.scale, strict=True) if n != name]
    names, scale = [n for n, _ in kept], [s for _, s in kept]
    return tuned(groups, names, scale, sweeps) if sweeps else fixed(groups, names, scale)
