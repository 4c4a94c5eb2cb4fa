"""ZYZ Euler angles, with which the paper describes orientations: R = Rz(alpha) Ry(beta) Rz(gamma)."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.typing import Floats

LEAST_TILT = 0.02
"""Sine of beta below which alpha and gamma are angles about nearly the same axis, and not well defined. Assumed."""


def well_defined(R: Floats) -> bool:
    """Whether ZYZ angles are well defined for all rotations (N, 3, 3): no z axis is along that of the fixed frame."""
    return bool((np.hypot(R[:, 0, 2], R[:, 1, 2]) >= LEAST_TILT).all())


def zyz(R: Floats) -> Floats:
    """(N, 3) angles alpha, beta, gamma, rad, of rotations (N, 3, 3); beta lies in [0, pi]."""
    return np.asarray(Rotation.from_matrix(R).as_euler("ZYZ"))


def zyz_change(R: Floats, before: Floats) -> Floats:
    """(N, 3) change, rad, of the angles from rotations ``before`` to R, both (N, 3, 3), the short way round."""
    change = zyz(R) - zyz(before)
    return np.asarray((change + np.pi) % (2.0 * np.pi) - np.pi)


def zyz_rates(R: Floats) -> Floats:
    """(N, 3, 3) derivative of the angles by the rotation vector in the fixed frame.

    It is unbounded near beta = 0 and pi, where the angles are singular.
    """
    alpha, beta, _ = zyz(R).T
    axes = np.zeros((len(R), 3, 3))  # columns: the axes of the rotations alpha, beta and gamma
    axes[:, 2, 0] = 1.0
    axes[:, 0, 1], axes[:, 1, 1] = -np.sin(alpha), np.cos(alpha)
    axes[:, 0, 2], axes[:, 1, 2], axes[:, 2, 2] = (
        np.cos(alpha) * np.sin(beta),
        np.sin(alpha) * np.sin(beta),
        np.cos(beta),
    )
    return np.asarray(np.linalg.inv(axes))
