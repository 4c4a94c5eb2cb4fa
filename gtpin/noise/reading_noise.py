"""The noise of measured numbers: a sigma for each group of numbers or declared by a row, and the drives' repeatability."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.kinematics.poses import chunks
from gtpin.typing import Floats, Indices, Mask

FARTHEST = 10.0
"""Distance from the instrument, over the median distance, beyond which a position counts as a gross error. Assumed: the
instrument does not stand among the poses.
"""
SMALLEST = 1e-7
"""Smallest sigma of noise, m and rad: encoders and interferometers read tenths of a micrometre. Derived: below it, rounding
errors of the kinematics are larger than the noise, and fits do not converge."""
ROUNDED = 1e-14
"""Variance in every direction, over the sum of those by the drives: next to a singular posture these are so large that
rounding errors of them exceed the instrument's noise. Derived: 36 products of double precision."""
USUAL_TURN = 5e-5
"""Usual noise of orientations, rad, of a tracker that has measured none. Assumed."""


@dataclass(frozen=True, eq=False)
class ReadingNoise:
    """Noise of every number of N rows, as standard deviations. The instruments' noises are independent.

    - ``sigma``: (G,) sigma of each group of numbers, m or rad.
    - ``group``: (N, c) group of each number.
    - ``row_sigma``: (N, c) sigma that a row declares for a number; NaN where it declares none.
    - ``estimated``: (G,) whether the group's sigma was estimated from the data.
    - ``repeatability``: standard deviation with which every actuator returns to a command, m or rad.
    - ``sight``: (N, 3) unit vectors from a single tracker to what it measures; None where its station is not known.
    - ``reach``: (N,) distance from there, divided by the mean distance; None where ``sight`` is None.
    - ``range_ratio``: noise along the line of sight divided by noise across it, at the mean distance. A position's sigma is
      then the root mean square over the axes at this distance.
    - ``source``: where the estimated sigmas come from: ``declared`` where none is estimated, ``repeats`` or ``residuals``.
    - ``dof``: degrees of freedom of the estimate of the sigmas; infinite where they are declared.
    """

    sigma: Floats
    group: Indices
    row_sigma: Floats
    estimated: Mask
    repeatability: float = 0.0
    sight: Floats | None = None
    reach: Floats | None = None
    range_ratio: float = 1.0
    source: str = "declared"
    dof: float = np.inf

    def at_rows_of(self, other: ReadingNoise) -> ReadingNoise:
        """The same noise for the rows of another, of the same groups of numbers."""
        return replace(self, group=other.group, row_sigma=other.row_sigma, sight=other.sight, reach=other.reach)

    def towards(self, position: Floats, station: Floats) -> ReadingNoise:
        """The same noise of a single tracker that stands at ``station`` (3,) and measures positions (N, 3), m, in its frame."""
        sight, reach = line_of_sight(position, station)
        return replace(self, sight=sight, reach=reach)

    @property
    def position_sigma(self) -> float:
        """Noise of a single tracker's positions, per axis, m; of other instruments the first sigma."""
        return float(self.sigma[0])

    @property
    def orientation_sigma(self) -> float:
        """Noise of a single tracker's orientations, per axis, rad; a usual one where they were not measured."""
        return float(self.sigma[1]) if len(self.sigma) > 1 else USUAL_TURN

    @property
    def known(self) -> bool:
        """Whether the noise was declared, or repeated visits showed it. Of a pose that of the position is enough: beside it,
        residuals show the noise of the orientation."""
        first = self.group[:, 0][~np.isfinite(self.row_sigma[:, 0])]
        return self.source != "residuals" or not self.estimated[np.unique(first)].any()

    @property
    def each(self) -> Floats:
        """(N, c) sigma of each number."""
        return np.where(np.isfinite(self.row_sigma), self.row_sigma, self.sigma[self.group])

    def covariance(self, by_command: Floats, components: int) -> Floats:
        """(N, c, c) covariance of each row; ``by_command`` (N, c, n) is the derivative of the readings by the commands."""
        own = np.asarray(self.each[:, :, None] ** 2 * np.eye(components))
        if self.sight is not None and self.reach is not None:
            own[:, :3, :3] = self.sigma[0] ** 2 * sight_shape(self.sight, self.reach, self.range_ratio)
        if self.repeatability > 0.0:
            J = self.repeatability * by_command[:, :components]
            own += J @ np.swapaxes(J, 1, 2) + ROUNDED * (J**2).sum(axis=(1, 2))[:, None, None] * np.eye(components)
        return own

    def whitening(self, by_command: Floats, components: int) -> Floats:
        """(N, c, c) matrices W with W'W the inverse of the covariance; a read-only view where all are equal."""
        if self.repeatability == 0.0 and self.sight is None:
            if self.group.strides[0] == 0 and self.row_sigma.strides[0] == 0:
                return np.broadcast_to(np.diag(1.0 / self.each[0]), (len(self.group), components, components))
            return np.asarray(np.eye(components) / self.each[:, :, None])
        whitening = np.empty((len(self.group), components, components))
        for rows in chunks(len(self.group)):
            covariance = self.take(rows).covariance(by_command[rows], components)
            whitening[rows] = np.linalg.inv(np.linalg.cholesky(covariance))
        return whitening

    def whitened(self, by_command: Floats, values: Floats) -> Floats:
        """(N, c) values in units of the noise."""
        found = np.empty_like(values)
        for rows in chunks(len(values)):
            whitening = self.take(rows).whitening(by_command[rows], values.shape[1])
            found[rows] = np.einsum("nij,nj->ni", whitening, values[rows])
        return found

    def take(self, rows: npt.NDArray[np.generic] | slice) -> ReadingNoise:
        """The noise of some of the rows."""
        count = len(np.empty(len(self.group), dtype=np.int8)[rows])
        # Views of one row for all stay views.
        group, own = self.group, self.row_sigma
        some = replace(
            self,
            group=group[rows] if group.strides[0] else np.broadcast_to(group[0], (count, group.shape[1])),
            row_sigma=own[rows] if own.strides[0] else np.broadcast_to(own[0], (count, own.shape[1])),
        )
        if self.sight is None or self.reach is None:
            return some
        return replace(some, sight=self.sight[rows], reach=self.reach[rows])

    def scaled(self, factor: float) -> ReadingNoise:
        """The same noise with every sigma multiplied by a factor."""
        return replace(
            self,
            sigma=self.sigma * factor,
            row_sigma=self.row_sigma * factor,
            repeatability=self.repeatability * factor,
        )

    def sized_as(self, other: object) -> ReadingNoise:
        """The same noise with the sigmas and the repeatability of another."""
        assert isinstance(other, ReadingNoise)
        return replace(self, sigma=other.sigma, repeatability=other.repeatability)

    def at_least(self, sigma: float) -> ReadingNoise:
        """The same noise with instruments' sigmas of at least ``sigma``, m and rad."""
        one = self.row_sigma[:1] if self.row_sigma.strides[0] == 0 else self.row_sigma  # a view of one row stays one
        own = np.broadcast_to(np.maximum(one, sigma), self.row_sigma.shape)
        return replace(self, sigma=np.maximum(self.sigma, sigma), row_sigma=own)


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

    from scipy.optimize import minimize_scalar

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
