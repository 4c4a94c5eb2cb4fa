"""A tilt sensor on the platform."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gtpin.bench.simulator.instruments.gauge import Gauge, Hidden
from gtpin.bench.simulator.instruments.layout import Layout
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rotations import exp
from gtpin.data.table import Column
from gtpin.errors import GtpinError
from gtpin.typing import Floats, Ints

SIGMA = 2e-5
MOUNT_SIGMA = 1e-2
"""Standard deviation of the mounting's rotation, per axis, rad: the prior sigma that a dataset has by default."""

STEEP = 0.1
"""Smallest absolute third component of the measured unit vector. Below it the sensor does not read: the two others then
hardly depend on the tilt, and noise can make their squares sum to more than 1."""


@dataclass(frozen=True, eq=False)
class Tilt(Gauge):
    """z: the first two components of R_s' up, with R_s = R exp(mount). The sensor's axes are the TCP's, rotated by its
    mounting.

    Parameters
    ----------
    up
        (3,) unit vector against gravity, base frame.
    """

    kind: ClassVar[str] = "tilt"

    up: Floats

    @staticmethod
    def drawn(layout: Layout, poses: Poses, stops: Ints, declared: bool, rng: np.random.Generator) -> Tilt:
        """A sensor that reads at those of the ``stops``, with ``poses`` (M), at which its z axis is not too near horizontal.

        Raises
        ------
        GtpinError
            If there are fewer than two such stops.
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
