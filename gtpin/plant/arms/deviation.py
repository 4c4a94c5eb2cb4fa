"""What effects do to an arm and to what is seen of it: small changes that add up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.plant.deviation import Additive

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ArmDeviation(Additive):
    """Changes at N visits of an arm with n commanded joints.

    Parameters
    ----------
    travel
        (N, n) of the joints' coordinates, rad or m.
    axis
        (N, n, 6) of the joints' axes: shift, m, and rotation vector, rad, in the joint's frame as it stands on its parent.
    tip
        (N, n, 6) of the ends of the links that the joints move: shift, m, and turn there, rad, in the link's frame.
    target
        (N, 3) of the target, its own frame, m.
    frame, scale
        (N, 6), (N,) as in :class:`~gtpin.plant.deviation.Deviation`.
    """

    travel: Floats
    axis: Floats
    tip: Floats
    target: Floats
    frame: Floats
    scale: Floats

    @staticmethod
    def none(visits: int, joints: int) -> ArmDeviation:
        """No change at all."""
        return ArmDeviation(
            travel=np.zeros((visits, joints)),
            axis=np.zeros((visits, joints, 6)),
            tip=np.zeros((visits, joints, 6)),
            target=np.zeros((visits, 3)),
            frame=np.zeros((visits, 6)),
            scale=np.zeros(visits),
        )
