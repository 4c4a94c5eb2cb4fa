"""Smooth functions: sums of cosines whose typical sizes decrease with their order."""

from __future__ import annotations

import numpy as np

from gtpin.typing import Floats

GRID = np.linspace(-1.0, 1.0, 201)
"""Points at which a curve is evaluated to compute its size."""


def wave(x: Floats, order: int) -> Floats:
    """cos(pi order (x + 1) / 2) for x (any shape) in [-1, 1]. For order 1 and higher its mean over the interval is zero."""
    return np.asarray(np.cos(np.pi / 2.0 * order * (x + 1.0)))


def cosines(x: Floats, first: int, last: int, decay: float = 1.0) -> tuple[Floats, Floats]:
    """(N, m) cosines of orders first to last over x (N,) in [-1, 1], and (m,) their typical sizes.

    The size of order k is proportional to k^-decay. With these sizes, the variance of the sum of cosines is one on average
    over x.
    """
    orders = np.arange(first, last + 1)
    size = orders**-decay / np.sqrt((orders ** (-2.0 * decay)).sum() / 2.0)
    return np.cos(np.pi / 2.0 * orders * (x[:, None] + 1.0)), np.asarray(size, dtype=float)


def extent(coefficients: Floats) -> tuple[float, float]:
    """Root mean square and peak to valley of a sum of cosines of orders 1 to m, with coefficients (m,), in their unit.

    The best straight line is subtracted first, as in the definition of straightness in ISO 230-1. Peak to valley is the
    largest less the smallest value.
    """
    values = cosines(GRID, 1, len(coefficients))[0] @ coefficients
    left = values - values.mean() - GRID * (GRID @ values) / (GRID @ GRID)  # the middle of the grid is zero
    return float(np.sqrt((left**2).mean())), float(np.ptp(left))


def span(coefficients: Floats) -> float:
    """Largest less smallest value of a sum of cosines of orders 1 to m, with coefficients (m,), in their unit."""
    return float(np.ptp(cosines(GRID, 1, len(coefficients))[0] @ coefficients))


def modulated(column: Floats, coordinates: list[Floats], share: float, orders: int = 2) -> tuple[Floats, Floats]:
    """A displacement (N,) and its modulation: the displacement times cosines of coordinates (N,).

    The coordinates have no unit; most of their values are between -1 and 1. The cosines have orders 1 to ``orders``.

    Returns
    -------
    columns, size
        (N, m) the displacement first, then its modulation, and (m,) their sizes relative to the displacement:
        ``share / order`` for each coordinate and order.
    """
    columns, sizes = [column], [1.0]
    for x in coordinates:
        for order in range(1, orders + 1):
            columns.append(column * np.cos(np.pi / 2.0 * order * (np.clip(x, -3.0, 3.0) + 1.0)))
            sizes.append(share / order)
    return np.stack(columns, axis=1), np.array(sizes)
