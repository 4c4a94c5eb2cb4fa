"""How hard an effect is to see: the whitened energy of what it does to the poses, past what geometry absorbs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve

from gtpin.plant.arms.machine import ArmMachine
from gtpin.plant.machine import Machine
from gtpin.plant.poses import Poses

Floats = npt.NDArray[np.float64]


class Past(Protocol):
    """What measures how hard an effect is to see."""

    def energy(self, displacement: Floats) -> float:
        """E of a displacement (N, 6) of the poses, m and rad, base frame, and of the joints that are read, if any."""


@dataclass(frozen=True)
class PastGeometry:
    """Measures displacements d (N, 6) by E = d' (I + B B')^-1 d, all whitened by the instrument's sigmas.

    Parameters
    ----------
    B
        (6 N, p) whitened derivative of the poses by the geometry's parameters, in units of their tolerances.
    sigma
        (6,) m and rad.
    """

    B: Floats
    sigma: Floats

    @staticmethod
    def of(machine: Machine | ArmMachine, q: Floats, poses: Poses, sigma: Floats) -> PastGeometry:
        """For measured commands q (N, n) of a machine and its poses there."""
        return PastGeometry((machine.by_tolerance(q, poses) / sigma[:, None]).reshape(6 * len(q), -1), sigma)

    def energy(self, displacement: Floats) -> float:
        """E of a displacement (N, 6), m and rad, by Woodbury's identity."""
        d = (displacement / self.sigma).ravel()
        projected = self.B.T @ d
        absorbed = projected @ cho_solve(cho_factor(np.eye(len(projected)) + self.B.T @ self.B), projected)
        return float(d @ d - absorbed)
