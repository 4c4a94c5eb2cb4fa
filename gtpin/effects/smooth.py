"""Smooth functions: cosines with scales that decay with their order."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

GRID = np.linspace(-1.0, 1.0, 201)
"""Where a curve is looked at to say how large it is."""


def wave(x: Floats, order: int) -> Floats:
    """Cosine of an order over x (any shape) in [-1, 1]; of mean zero from order 1 on."""
    return np.asarray(np.cos(np.pi / 2.0 * order * (x + 1.0)))


def cosines(x: Floats, first: int, last: int, decay: float = 1.0) -> tuple[Floats, Floats]:
    """(N, m) cosines of orders first to last over x (N,) in [-1, 1], and (m,) their sizes, of unit total variance."""
    orders = np.arange(first, last + 1)
    size = orders**-decay / np.sqrt((orders ** (-2.0 * decay)).sum() / 2.0)
    return np.cos(np.pi / 2.0 * orders * (x[:, None] + 1.0)), np.asarray(size, dtype=float)


def extent(coefficients: Floats) -> tuple[float, float]:
    """Root mean square, and difference of the largest and the least value, of a curve of cosines (m,) from order 1 on.

    Both are about the straight line that fits the curve best, as ISO 230-1 has straightness.
    """
    values = cosines(GRID, 1, len(coefficients))[0] @ coefficients
    left = values - np.polynomial.Polynomial.fit(GRID, values, 1)(GRID)
    return float(np.sqrt((left**2).mean())), float(np.ptp(left))


def span(coefficients: Floats) -> float:
    """Difference of the largest and the least value of a curve of cosines (m,) from order 1 on."""
    return float(np.ptp(cosines(GRID, 1, len(coefficients))[0] @ coefficients))


def modulated(column: Floats, coordinates: list[Floats], share: float, orders: int = 2) -> tuple[Floats, Floats]:
    """A displacement (N,) and its modulation: itself times slow functions of coordinates (N,) about -1 to 1.

    Returns
    -------
    columns, size
        (N, m) the displacement first, and (m,) the size of each relative to it: ``share`` in all for each coordinate.
    """
    columns, sizes = [column], [1.0]
    for x in coordinates:
        for order in range(1, orders + 1):
            columns.append(column * np.cos(np.pi / 2.0 * order * (np.clip(x, -3.0, 3.0) + 1.0)))
            sizes.append(share / order)
    return np.stack(columns, axis=1), np.array(sizes)
