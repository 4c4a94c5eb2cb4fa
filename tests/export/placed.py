"""Frames that the tests read out of other software's models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray


@dataclass(frozen=True)
class Placed:
    """A frame: rotation and origin."""

    R: Array
    T: Array

    def __matmul__(self, other: Placed) -> Placed:
        return Placed(self.R @ other.R, self.T + self.R @ other.T)

    def at(self, point: Array) -> Array:
        return self.T + self.R @ point

    def inverse(self) -> Placed:
        return Placed(self.R.T, -self.R.T @ self.T)

    @staticmethod
    def of(numbers: str) -> Placed:
        """Six numbers of an SDF: x y z roll pitch yaw."""
        x = np.array([float(word) for word in numbers.split()])
        return Placed(Rotation.from_euler("xyz", x[3:]).as_matrix(), x[:3])
