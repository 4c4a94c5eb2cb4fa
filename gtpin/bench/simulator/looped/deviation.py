"""Deviations of a machine with loops: those of an arm, and those of the axes of all joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.bench.simulator.arms.deviation import ArmDeviation
from gtpin.typing import Floats


@dataclass(frozen=True)
class LoopedDeviation(ArmDeviation):
    """Changes at N visits of a machine with J joints, n of them commanded.

    Parameters
    ----------
    seat
        (N, J, 6) change of the axes of all joints, including passive ones: shift, m, and rotation vector, rad, in the joint's
        frame at coordinate zero.
    """

    seat: Floats

    @staticmethod
    def at_rest(visits: int, commanded: int, joints: int) -> LoopedDeviation:
        """Zeros."""
        return LoopedDeviation(**vars(ArmDeviation.none(visits, commanded)), seat=np.zeros((visits, joints, 6)))
