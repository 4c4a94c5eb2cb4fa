"""The noise of measured poses: the instrument's, and the machine's own repeatability."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats

SMALLEST = 1e-7
"""Smallest sigma of noise, m and rad: encoders and interferometers read tenths of a micrometre. Derived: below it, rounding
errors of the kinematics are larger than the noise, and fits do not converge."""


@dataclass(frozen=True)
class Noise:
    """Noise of every measured pose, as standard deviations.

    - ``position_sigma``: instrument's noise of a position, per axis, m. Where it depends on the distance: the root mean
      square over the axes at the mean distance.
    - ``orientation_sigma``: instrument's noise of an orientation, per axis, rad.
    - ``repeatability``: standard deviation with which every actuator returns to a command, m or rad.
    - ``sight``: (N, 3) unit vectors from the instrument to the poses; None where the instrument's position is not known.
    - ``reach``: (N,) distance from the instrument to each pose, divided by the mean distance; None where ``sight`` is None.
    - ``range_ratio``: noise along the line of sight divided by noise across it, at the mean distance.
    - ``source``: where the instrument's sigmas come from: ``declared``, ``repeats`` or ``residuals``.
    - ``dof``: degrees of freedom of the estimate of the sigmas; infinite where they are declared.
    - ``estimated``: whether ``position_sigma`` and ``orientation_sigma`` were estimated from the data.
    - ``lack``: standard deviation, m or rad, of errors along the motion of every actuator that the model does not explain.
      They are similar at neighbouring poses, so they are not repeatability, but ``covariance`` treats them in the same way.
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

    @staticmethod
    def of(noise: ReadingNoise) -> Noise:
        """The noise of a lone tracker's rows: positions have the first sigma, orientations the second."""
        turning = len(noise.sigma) > 1
        return Noise(
            float(noise.sigma[0]),
            float(noise.sigma[1]) if turning else 5e-5,
            noise.repeatability,
            noise.sight,
            noise.reach,
            noise.range_ratio,
            noise.source,
            noise.dof,
            (bool(noise.estimated[0]), bool(noise.estimated[1]) if turning else True),
            noise.lack,
        )

    def rows(self, count: int, components: int) -> ReadingNoise:
        """The noise of ``count`` rows, each with the 3 or 6 ``components`` of a pose."""
        group = np.array([0, 0, 0, 1, 1, 1])[:components]
        return ReadingNoise(
            np.array([self.position_sigma, self.orientation_sigma])[: 1 + group[-1]],
            np.broadcast_to(group, (count, components)),
            np.broadcast_to(np.full(components, np.nan), (count, components)),
            np.array(self.estimated)[: 1 + group[-1]],
            self.repeatability,
            self.lack,
            self.sight,
            self.reach,
            self.range_ratio,
            self.source,
            self.dof,
        )

    def covariance(self, command_jacobian: Floats, components: int) -> Floats:
        """(N, c, c) covariance of measured poses, m and rad: of the position (c = 3), or also of the rotation vector (c = 6).

        ``command_jacobian``: (N, 6, n) derivative of the poses by the commands, in the instrument's frame. ``components``:
        c, 3 or 6.
        """
        return self.rows(len(command_jacobian), components).covariance(command_jacobian, components)

    def whitening(self, command_jacobian: Floats, components: int) -> Floats:
        """(N, c, c) matrices W with W'W the inverse of the covariance; a read-only view where all are equal."""
        return self.rows(len(command_jacobian), components).whitening(command_jacobian, components)

    @property
    def along_drives(self) -> float:
        """Root of the sum of the squares of ``repeatability`` and ``lack``, m or rad."""
        return float(np.hypot(self.repeatability, self.lack))

    def scaled(self, factor: float) -> Noise:
        """The same noise with every sigma multiplied by a factor."""
        return replace(
            self,
            position_sigma=self.position_sigma * factor,
            orientation_sigma=self.orientation_sigma * factor,
            repeatability=self.repeatability * factor,
            lack=self.lack * factor,
        )
