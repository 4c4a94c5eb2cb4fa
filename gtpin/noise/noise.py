"""The noise of measured poses: the instrument's, and the machine's own repeatability."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.kinematics.poses import chunks
from gtpin.typing import Floats

SMALLEST = 1e-7
"""Smallest sigma of noise, m and rad: encoders and interferometers read tenths of a micrometre. Derived: below it, rounding
errors of the kinematics are larger than the noise, and fits do not converge."""


@dataclass(frozen=True)
class Noise:
    """Noise of every measured pose, as standard deviations.

    Parameters
    ----------
    position_sigma
        Instrument's noise of a position, per axis, m. Where it depends on the distance: the root mean square over the axes at
        the mean distance.
    orientation_sigma
        Instrument's noise of an orientation, per axis, rad.
    repeatability
        Standard deviation with which every actuator returns to a command, m or rad.
    sight
        (N, 3) unit vectors from the instrument to the poses; None where the instrument's position is not known.
    reach
        (N,) distance from the instrument to each pose, divided by the mean distance; None where ``sight`` is None.
    range_ratio
        Noise along the line of sight divided by noise across it, at the mean distance.
    source
        Where the instrument's sigmas come from: ``declared``, ``repeats`` or ``residuals``.
    dof
        Degrees of freedom of the estimate of the sigmas; infinite where they are declared.
    estimated
        Whether ``position_sigma`` and ``orientation_sigma`` were estimated from the data.
    lack
        Standard deviation, m or rad, of errors along the motion of every actuator that the model does not explain. They are
        similar at neighbouring poses, so they are not repeatability, but ``covariance`` treats them in the same way.
    """

    position_sigma: float
    orientation_sigma: float
    repeatability: float = 0.0
    sight: Floats | None = None
    reach: Floats | None = None
    range_ratio: float = 1.0
    source: str = "declared"
    dof: float = np.inf
    estimated: tuple[bool, bool] = (False, False)
    lack: float = 0.0

    def covariance(self, command_jacobian: Floats, components: int) -> Floats:
        """(N, c, c) covariance of measured poses, m and rad: of the position (c = 3), or also of the rotation vector (c = 6).

        Parameters
        ----------
        command_jacobian
            (N, 6, n) derivative of the poses by the commands, in the instrument's frame.
        components
            c, 3 or 6.
        """
        count = len(command_jacobian)
        covariance = np.zeros((count, components, components))
        covariance[:, :3, :3] = self.position_sigma**2 * self.shape(count)
        if components == 6:
            covariance[:, 3:, 3:] = self.orientation_sigma**2 * np.eye(3)
        if self.along_drives > 0.0:
            J = command_jacobian[:, :components]
            covariance += self.along_drives**2 * (J @ np.swapaxes(J, 1, 2))
        return covariance

    @property
    def along_drives(self) -> float:
        """Root of the sum of the squares of ``repeatability`` and ``lack``, m or rad."""
        return float(np.hypot(self.repeatability, self.lack))

    def whitening(self, command_jacobian: Floats, components: int) -> Floats:
        """(N, c, c) matrices W with W'W the inverse of the covariance; a read-only view where all are equal."""
        count = len(command_jacobian)
        if self.along_drives == 0.0 and self.sight is None:
            sigma = np.array([self.position_sigma] * 3 + [self.orientation_sigma] * 3)[:components]
            return np.broadcast_to(np.diag(1.0 / sigma), (count, components, components))
        whitening = np.empty((count, components, components))
        for rows in chunks(count):
            covariance = self.take(rows).covariance(command_jacobian[rows], components)
            whitening[rows] = np.linalg.inv(np.linalg.cholesky(covariance))
        return whitening

    def scaled(self, factor: float) -> Noise:
        """The same noise with every sigma multiplied by a factor."""
        return replace(
            self,
            position_sigma=self.position_sigma * factor,
            orientation_sigma=self.orientation_sigma * factor,
            repeatability=self.repeatability * factor,
            lack=self.lack * factor,
        )

    def sized_as(self, other: object) -> Noise:
        """The same noise with the sigmas and the repeatability of another."""
        assert isinstance(other, Noise)
        return replace(
            self,
            position_sigma=other.position_sigma,
            orientation_sigma=other.orientation_sigma,
            repeatability=other.repeatability,
        )

    def at_least(self, sigma: float) -> Noise:
        """The same noise with ``position_sigma`` and ``orientation_sigma`` of at least ``sigma``, m and rad."""
        return replace(
            self,
            position_sigma=max(self.position_sigma, sigma),
            orientation_sigma=max(self.orientation_sigma, sigma),
        )

    def take(self, rows: npt.NDArray[np.generic] | slice) -> Noise:
        """The noise of some of the poses."""
        if self.sight is None or self.reach is None:
            return self
        return replace(self, sight=self.sight[rows], reach=self.reach[rows])

    def shape(self, count: int) -> Floats:
        """(N, 3, 3) covariance of the positions divided by position_sigma^2."""
        if self.sight is None or self.reach is None:
            return np.broadcast_to(np.eye(3), (count, 3, 3))
        return sight_shape(self.sight, self.reach, self.range_ratio)


def sight_shape(sight: Floats, reach: Floats, range_ratio: float) -> Floats:
    """(N, 3, 3) covariance of positions over sigma^2, for noise that is not equal along and across the line of sight."""
    along = sight[:, :, None] * sight[:, None, :]
    across = np.eye(3) - along
    level = 3.0 / (range_ratio**2 + 2.0)
    return np.asarray(level * (range_ratio**2 * along + reach[:, None, None] ** 2 * across))
