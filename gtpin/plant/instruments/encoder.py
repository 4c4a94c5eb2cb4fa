"""An encoder at a joint that nothing drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from gtpin.data.table import Column
from gtpin.plant.instruments.gauge import Gauge, Hidden
from gtpin.plant.poses import Poses

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int_]

SIGMA = 2e-5
ZERO_SIGMA = 1e-2
"""What a dataset takes the zero's error for, where it does not say (the contract's), rad or m: it is drawn from it."""


@dataclass(frozen=True, eq=False)
class Encoder(Gauge):
    """z = x + zero, with x the joint's coordinate.

    Parameters
    ----------
    joint
        Its name.
    coordinate
        (M,) where it really is, rad or m.
    """

    kind: ClassVar[str] = "encoder"

    joint: str
    coordinate: Floats

    @staticmethod
    def drawn(joint: str, coordinate: Floats, stops: Ints, declared: bool, rng: np.random.Generator) -> Encoder:
        """One that reads the coordinates (M,) of a joint at all stops."""
        zero = Hidden("encoder.zero", ZERO_SIGMA * rng.standard_normal(), ZERO_SIGMA)
        return Encoder("encoder", stops, (zero,), declared, joint, coordinate)

    @property
    def sigma(self) -> Floats:
        """See :class:`Gauge`."""
        return np.full((len(self.stop), 1), SIGMA)

    def readings(self, poses: Poses, u: Floats) -> Floats:
        """See :class:`Gauge`; it does not go by the platform's pose."""
        return np.asarray(self.coordinate + u[0])[:, None]

    def table(self) -> dict[str, Any]:
        """See :class:`Gauge`."""
        return {"joint": self.joint}

    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """See :class:`Gauge`."""
        return {"reading": (self.readings(poses, self.truth) + errors)[:, 0]}

    @classmethod
    def by_row(cls) -> tuple[str, ...]:
        """See :class:`Gauge`."""
        return "stop", "coordinate"
