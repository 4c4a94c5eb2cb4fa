"""What effects do to a machine with loops: what they do to an arm, and to the pins of joints that follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.plant.arms.deviation import ArmDeviation

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class LoopedDeviation(ArmDeviation):
    """Changes at N visits of a machine with J joints, n of them commanded.

    Parameters
    ----------
    seat
        (N, J, 6) of the axes of all joints, those that follow as well: shift, m, and rotation vector, rad, in the joint's
        frame as it stands on its parent.
    """

    seat: Floats

    @staticmethod
    def at_rest(visits: int, commanded: int, joints: int) -> LoopedDeviation:
        """No change at all."""
        return LoopedDeviation(**vars(ArmDeviation.none(visits, commanded)), seat=np.zeros((visits, joints, 6)))
