"""The noise of poses that a tracker measures, or would measure: the instrument's, and the machine's own repeatability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats


@dataclass(frozen=True)
class Noise:
    """Noise of every measured pose, as standard deviations.

    - ``position_sigma``: instrument's noise of a position, per axis, m.
    - ``orientation_sigma``: instrument's noise of an orientation, per axis, rad.
    - ``repeatability``: standard deviation with which every actuator returns to a command, m or rad.
    """

    position_sigma: float
    orientation_sigma: float
    repeatability: float = 0.0

    def rows(self, count: int, components: int) -> ReadingNoise:
        """The noise of ``count`` rows, each with the 3 or 6 ``components`` of a pose."""
        group = np.array([0, 0, 0, 1, 1, 1])[:components]
        sigma = np.array([self.position_sigma, self.orientation_sigma])[: 1 + group[-1]]
        groups = np.broadcast_to(group, (count, components))
        by_row = np.broadcast_to(np.full(components, np.nan), (count, components))
        return ReadingNoise(sigma, groups, by_row, np.zeros(len(sigma), dtype=bool), self.repeatability)

    def whitening(self, command_jacobian: Floats, components: int) -> Floats:
        """(N, c, c) matrices W with W'W the inverse of the covariance; a read-only view where all are equal.

        ``command_jacobian``: (N, 6, n) derivative of the poses by the commands, in the instrument's frame. ``components``:
        c, 3 or 6.
        """
        return self.rows(len(command_jacobian), components).whitening(command_jacobian, components)

    def scaled(self, factor: float) -> Noise:
        """The same noise with every sigma multiplied by a factor."""
        return Noise(self.position_sigma * factor, self.orientation_sigma * factor, self.repeatability * factor)
