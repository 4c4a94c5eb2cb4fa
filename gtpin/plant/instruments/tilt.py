"""A tilt sensor on the platform."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from gtpin.data.table import Column
from gtpin.errors import GtpinError
from gtpin.plant.instruments.gauge import Gauge, Hidden
from gtpin.plant.instruments.layout import Layout
from gtpin.plant.poses import Poses
from gtpin.plant.rotations import exp

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int_]

SIGMA = 2e-5
MOUNT_SIGMA = 1e-2
"""What a dataset takes the mounting's error for, where it does not say (the contract's), rad: it is drawn from it."""

STEEP = 0.1
"""Third component below which it does not read: the other two tell next to nothing, and with noise are no unit vector's."""


@dataclass(frozen=True, eq=False)
class Tilt(Gauge):
    """Two components of R_s' up, with R_s = R exp(mount): the sensor sits along the TCP's axes but for its mounting.

    Parameters
    ----------
    up
        (3,) unit vector against gravity, base frame.
    """

    kind: ClassVar[str] = "tilt"

    up: Floats

    @staticmethod
    def drawn(layout: Layout, poses: Poses, stops: Ints, declared: bool, rng: np.random.Generator) -> Tilt:
        """A sensor that reads at those stops, with poses (M), at which it is not too steep.

        Raises
        ------
        GtpinError
            If there are fewer than two.
        """
        name, level = "level", np.abs(poses.R[:, :, 2] @ layout.up) >= STEEP
        if len(stops) < 2:
            raise GtpinError("one stop alone for a tilt sensor", hint="ask for two poses or more")
        if level.sum() < 2:
            hint = "turn its TCP frame so that z is nearly upright"
            raise GtpinError("a tilt sensor on this robot is never near level", hint=hint)
        stops = stops[level]
        mount = [Hidden(f"{name}.mount.r{axis}", MOUNT_SIGMA * rng.standard_normal(), MOUNT_SIGMA) for axis in "xyz"]
        return Tilt(name, stops, tuple(mount), declared, layout.up)

    @property
    def sigma(self) -> Floats:
        """See :class:`Gauge`."""
        return np.full((len(self.stop), 2), SIGMA)

    def readings(self, poses: Poses, u: Floats) -> Floats:
        """See :class:`Gauge`."""
        return np.asarray((np.swapaxes(poses.R @ exp(u), 1, 2) @ self.up)[:, :2])

    def table(self) -> dict[str, Any]:
        """See :class:`Gauge`."""
        return {}

    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """See :class:`Gauge`."""
        values = self.readings(poses, self.truth) + errors
        return {"tilt_x": values[:, 0], "tilt_y": values[:, 1]}
