"""Observability of the geometry: variance reduction by direction, unobservable directions, observability indices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.errors import renamed
from gtpin.typing import Floats

UNSEEN = 0.5
"""A direction counts as unobservable if its variance reduction is below this value. Assumed."""
NAMED = 0.1
"""Smallest weight of a parameter that is listed in a direction. Assumed."""


@dataclass(frozen=True)
class Direction:
    """A direction in parameter space.

    ``weights``: by parameter name: component of the direction's unit vector, in units of the tolerances. The largest first;
    absolute values below 0.1 are left out. ``variance_reduction``: 1 minus posterior variance over prior variance, along the
    direction.
    """

    weights: dict[str, float]
    variance_reduction: float
    learned = renamed("learned", "variance_reduction")


@dataclass(frozen=True)
class Observability:
    """Observability of the geometry, in units of tolerance.

    ``variance_reduction``: (p,) along each principal direction, smallest first. ``directions``: (p, p) the
    principal directions, one per column. ``indices``: O1 to O5 of the scaled whitened Jacobian's singular values s_1 >= ...
    >= s_p of m rows: (prod s)^(1/p) / sqrt(m), s_p / s_1, s_p, s_p^2 / s_1, 1 / sum(1 / s) (Borm and Menq 1991; Driels and
    Pathre 1990; Nahvi et al. 1994; Nahvi and Hollerbach 1996; Sun and Hollerbach 2008).
    """

    variance_reduction: Floats
    directions: Floats
    indices: dict[str, float]
    learned = renamed("learned", "variance_reduction")

    def unobservable(self, names: tuple[str, ...]) -> tuple[Direction, ...]:
        """Directions with a variance reduction below 0.5, the smallest first; ``names`` are those of the p parameters."""
        found = []
        for k in np.flatnonzero(self.variance_reduction < UNSEEN):
            vector = self.directions[:, k]
            vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
            order = np.argsort(-np.abs(vector))
            weights = {names[i]: float(vector[i]) for i in order if abs(vector[i]) >= NAMED}
            found.append(Direction(weights, float(self.variance_reduction[k])))
        return tuple(found)


def observability(factor: Floats, n_geometry: int, rows: int) -> Observability:
    """Compute the observability from the whitened derivatives.

    ``factor``: (r, size) any matrix F with F'F = J'J, such as J or its triangular factor. J is the whitened derivative of
    the data by the geometry, in units of the tolerances, and then by unknowns without a prior. ``n_geometry``: number of
    columns of the geometry. ``rows``: number of measured components.
    """
    free = factor.shape[1] - n_geometry
    # Unknowns without a prior (a free frame) absorb a part of the information: their columns come first and are eliminated.
    triangular = np.asarray(np.linalg.qr(np.hstack([factor[:, n_geometry:], factor[:, :n_geometry]]), mode="r"))
    _, s, Vt = np.linalg.svd(triangular[free:, free:])
    s = np.concatenate([s, np.zeros(n_geometry - len(s))])
    order = np.argsort(s)
    return Observability((s**2 / (1.0 + s**2))[order], Vt.T[:, order], _indices(s, rows))


def _indices(s: Floats, rows: int) -> dict[str, float]:
    if not s.size:
        return {}
    regular = bool(s[-1] > 1e-14 * s[0])
    return {
        "O1": float(np.exp(np.log(s).mean()) / np.sqrt(rows)) if regular else 0.0,
        "O2": float(s[-1] / s[0]) if s[0] > 0.0 else 0.0,
        "O3": float(s[-1]),
        "O4": float(s[-1] ** 2 / s[0]) if s[0] > 0.0 else 0.0,
        "O5": float(1.0 / (1.0 / s).sum()) if regular else 0.0,
    }
