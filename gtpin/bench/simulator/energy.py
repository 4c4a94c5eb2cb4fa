"""E of an effect: the whitened energy of its displacement of the poses that the geometry can't absorb."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.bench.simulator.machine import Machine
from gtpin.bench.simulator.poses import Poses
from gtpin.typing import Floats


class Past(Protocol):
    """Computes E of displacements."""

    def energy(self, displacement: Floats) -> float:
        """E of a displacement (N, 6 + k) of the poses, m and rad, base frame, and of k joints that are read."""


@dataclass(frozen=True)
class PastGeometry:
    """Computes E = d' (I + B B')^-1 d of displacements d (N, 6) that are whitened by the instrument's sigmas.

    Parameters
    ----------
    B
        (6 N, p) whitened derivative of the poses by the geometry's parameters, in units of their tolerances.
    sigma
        (6,) the instrument's sigmas, m and rad.
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
