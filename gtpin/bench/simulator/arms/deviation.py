"""Deviations of an arm and of its measurement, caused by effects. They are small, and are added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.bench.simulator.deviation import Additive
from gtpin.typing import Floats


@dataclass(frozen=True)
class ArmDeviation(Additive):
    """Changes at N visits of an arm with n commanded joints.

    Parameters
    ----------
    travel
        (N, n) change of the joints' coordinates, rad or m.
    axis
        (N, n, 6) change of the joints' axes: shift, m, and rotation vector, rad, in the joint's frame at coordinate zero.
    tip
        (N, n, 6) change of the ends of the links that the joints move: shift, m, and rotation vector, rad, link's frame.
    target
        (N, 3) shift of the target, in the target's frame, m.
    frame, scale
        (N, 6), (N,) as in :class:`~gtpin.bench.simulator.deviation.Deviation`.
    """

    travel: Floats
    axis: Floats
    tip: Floats
    target: Floats
    frame: Floats
    scale: Floats

    @staticmethod
    def none(visits: int, joints: int) -> ArmDeviation:
        """Zeros."""
        return ArmDeviation(
            travel=np.zeros((visits, joints)),
            axis=np.zeros((visits, joints, 6)),
            tip=np.zeros((visits, joints, 6)),
            target=np.zeros((visits, 3)),
            frame=np.zeros((visits, 6)),
            scale=np.zeros(visits),
        )
