"""The line of sight of an instrument: the noise along it and the noise across it are not equal."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from gtpin.typing import Floats

FARTHEST = 10.0
"""Distance from the instrument, over the median distance, beyond which a position counts as a gross error. Assumed: the
instrument does not stand among the poses.
"""


def line_of_sight(position: Floats, station: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (N, 3) from a station to positions (N, 3), and the distances (N,) divided by their mean.

    Gross errors of position are left out of the mean, and their quotient is ``FARTHEST`` at most.
    """
    sight = position - station
    size = np.abs(sight).max(axis=1, keepdims=True)  # the square of a gross error may overflow
    unit = sight / size
    length = np.linalg.norm(unit, axis=1)
    distance = length * size[:, 0]
    near = distance[distance <= FARTHEST * np.median(distance)].mean()
    return unit / length[:, None], np.minimum(distance / near, FARTHEST)


def range_ratio(sight: Floats, reach: Floats, residual: Floats) -> float:
    """Noise along the line of sight divided by noise across it, by maximum likelihood from residuals (N, 3), m.

    Only the ratio is estimated, on which an unmodelled effect has little influence. ``sight`` (N, 3) and ``reach`` (N,) as in
    :class:`~gtpin.noise.reading_noise.ReadingNoise`.
    """

    def cost(log_ratio: float) -> float:
        shape = sight_shape(sight, reach, float(np.exp(log_ratio)))
        mahalanobis = np.einsum("ni,nij,nj->n", residual, np.linalg.inv(shape), residual).sum()
        # The overall size is maximised out, so that a lack of fit does not change the ratio.
        return float(1.5 * len(residual) * np.log(mahalanobis) + 0.5 * np.linalg.slogdet(shape)[1].sum())

    found = minimize_scalar(cost, bounds=(np.log(0.05), np.log(3.0)), method="bounded")
    return float(np.exp(found.x))


def sight_shape(sight: Floats, reach: Floats, range_ratio: float) -> Floats:
    """(N, 3, 3) covariance of positions over sigma^2, for noise that is not equal along and across the line of sight."""
    along = sight[:, :, None] * sight[:, None, :]
    across = np.eye(3) - along
    level = 3.0 / (range_ratio**2 + 2.0)
    return np.asarray(level * (range_ratio**2 * along + reach[:, None, None] ** 2 * across))
