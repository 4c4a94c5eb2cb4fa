"""The model: a robot's geometry, and where the instrument that watches it stands."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.kinematics.kinematics import Kinematics, kinematics
from gtpin.kinematics.poses import Poses
from gtpin.robot.geometry import Geometry
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Frame:
    """Where the robot's base frame lies in the instrument's frame: T (3,), m, and R (3, 3)."""

    T: Floats = field(default_factory=lambda: np.zeros(3))
    R: Floats = field(default_factory=lambda: np.eye(3))

    @property
    def is_base(self) -> bool:
        """Whether the instrument measures in the base frame."""
        return not self.T.any() and bool((np.eye(3) == self.R).all())


@dataclass(frozen=True)
class Model:
    """What predicts poses: a geometry, and the frame that the instrument measures in.

    It knows nothing of the data that it came from.

    Parameters
    ----------
    geometry
        Of a robot.
    frame
        The base frame in the instrument's frame; left out, the instrument measures in the base frame.
    """

    geometry: Geometry
    frame: Frame = field(default_factory=Frame)

    @property
    def robot(self) -> Robot:
        """The robot, with nominal geometry."""
        return self.geometry.robot

    @cached_property
    def kinematics(self) -> Kinematics:
        """The kinematics of its geometry, in the base frame."""
        return kinematics(self.geometry)

    def predict(self, q: npt.ArrayLike) -> Poses:
        """Poses (N) that the instrument would read without noise at commands q (N, n), in the instrument's frame.

        A pose that the robot can't reach is NaN.
        """
        return self.seen(self.kinematics.forward(np.asarray(q, dtype=float)))

    def seen(self, poses: Poses) -> Poses:
        """Poses in the base frame as the instrument sees them."""
        return poses if self.frame.is_base else poses.moved(self.frame.T, self.frame.R)
