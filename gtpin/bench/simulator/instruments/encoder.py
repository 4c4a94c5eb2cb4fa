"""An encoder at a passive joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gtpin.bench.simulator.instruments.gauge import Gauge, Hidden
from gtpin.bench.simulator.poses import Poses
from gtpin.data.table import Column
from gtpin.errors import GtpinError
from gtpin.typing import Floats, Ints

SIGMA = 2e-5
ZERO_SIGMA = 1e-2
"""Standard deviation of the zero, rad or m: the prior sigma that a dataset has by default."""


@dataclass(frozen=True, eq=False)
class Encoder(Gauge):
    """z = x + zero, with x the joint's coordinate.

    Parameters
    ----------
    joint
        The joint's name.
    """

    kind: ClassVar[str] = "encoder"

    joint: str

    @staticmethod
    def drawn(poses: Poses, stops: Ints, declared: bool, rng: np.random.Generator) -> Encoder:
        """An encoder at the first joint whose coordinates the poses have; it reads at all stops.

        Raises
        ------
        GtpinError
            If they have none.
        """
        if not poses.joints:
            raise GtpinError(
                "no joint of this machine can be read by an encoder",
                hint="the plant has encoders at joints that follow: of loops, and of rods' universal joints",
            )
        zero = Hidden("encoder.zero", ZERO_SIGMA * rng.standard_normal(), ZERO_SIGMA)
        return Encoder("encoder", stops, (zero,), declared, next(iter(poses.joints)))

    @property
    def sigma(self) -> Floats:
        """See :class:`Gauge`."""
        return np.full((len(self.stop), 1), SIGMA)

    def readings(self, poses: Poses, u: Floats) -> Floats:
        """See :class:`Gauge`; they do not depend on the platform's pose."""
        return np.asarray(poses.joints[self.joint] + u[0])[:, None]

    def by_pose(self, poses: Poses) -> Floats:
        """See :class:`Gauge`."""
        return np.zeros((len(poses), 1, 6))

    def by_motion(self, poses: Poses) -> Floats:
        """See :class:`Gauge`."""
        own = [float(name == self.joint) for name in poses.joints]
        return np.tile(np.concatenate([np.zeros(6), own]), (len(poses), 1, 1))

    def table(self) -> dict[str, Any]:
        """See :class:`Gauge`."""
        return {"joint": self.joint}

    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """See :class:`Gauge`."""
        return {"reading": (self.readings(poses, self.truth) + errors)[:, 0]}
