"""Rotations in arrays, by the plant's own formulas."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from gtpin.typing import Floats

SMALL = 1e-4
"""Angle, rad, below which sines are replaced by their series: the next term is below 1e-18."""


def exp(vectors: npt.ArrayLike) -> Floats:
    """(..., 3, 3) rotation matrices of rotation vectors (..., 3), rad (Rodrigues)."""
    v = np.asarray(vectors, dtype=float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    safe = np.where(angle < SMALL, 1.0, angle)
    first = np.where(angle < SMALL, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    second = np.where(angle < SMALL, 0.5 - angle**2 / 24.0, 2.0 * (np.sin(safe / 2.0) / safe) ** 2)
    K = cross_matrix(v)
    return np.asarray(np.eye(3) + first * K + second * (K @ K))


def log(matrices: Floats) -> Floats:
    """(..., 3) rotation vectors, rad, of rotation matrices (..., 3, 3)."""
    return np.asarray(Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_rotvec()).reshape(matrices.shape[:-1])


def cross_matrix(vectors: Floats) -> Floats:
    """(..., 3, 3) matrices that multiply from the left as the cross product does."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    found = np.zeros((*vectors.shape, 3))
    found[..., 0, 1], found[..., 0, 2] = -z, y
    found[..., 1, 0], found[..., 1, 2] = z, -x
    found[..., 2, 0], found[..., 2, 1] = -y, x
    return found


def across(direction: Floats) -> Floats:
    """(2, 3) the unit vectors a and b across a direction (3,), as docs/conventions.md defines those of a track.

    a is the base axis that is least aligned with the direction, less its part along it; b is direction x a.
    """
    a = np.eye(3)[int(np.argmin(np.abs(direction)))]
    a = a - (a @ direction) * direction
    a = a / np.linalg.norm(a)
    (x, y, z), (u, v, w) = direction, a
    return np.array([a, [y * w - z * v, z * u - x * w, x * v - y * u]])
