"""Small motions of the parts of a machine, one set for each pose, and the rotations that both families of machines need."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Poses = tuple[Array, Array]  # positions (N, 3), m; rotations (N, 3, 3)


@dataclass(frozen=True)
class Motion:
    """What a mechanism moves, at N poses of a machine with n actuators and r rods; translations in m, rotations in rad."""

    drive: Array  # (N, n): travel beyond the command
    body: Array  # (N, n, 6): translation and rotation of each cart (base axes) or of each joint's link (joint's frame)
    rod: Array  # (N, r): growth of each rod
    frame: Array  # (N, 6): motion of what is measured, about the instrument's station
    target: Array  # (N, 6): motion of the target on the platform, in the TCP frame
    scale: Array  # (N,): the instrument's scale error, about its station

    @classmethod
    def none(cls, poses: int, actuators: int, rods: int) -> Motion:
        z = np.zeros
        return cls(
            z((poses, actuators)), z((poses, actuators, 6)), z((poses, rods)), z((poses, 6)), z((poses, 6)), z(poses)
        )

    def times(self, factor: float) -> Motion:
        return Motion(*(factor * getattr(self, f.name) for f in fields(self)))

    def plus(self, other: Motion) -> Motion:
        return Motion(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))


def rotations(vectors: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    return Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape((*vectors.shape[:-1], 3, 3))


def transforms(twists: Array) -> Array:
    """Homogeneous matrices (..., 4, 4) of (translation, rotation vector) (..., 6)."""
    T = np.zeros((*twists.shape[:-1], 4, 4))
    T[..., :3, :3] = rotations(twists[..., 3:])
    T[..., :3, 3] = twists[..., :3]
    T[..., 3, 3] = 1.0
    return T


def seen(poses: Poses, motion: Motion, station: Array) -> Poses:
    """Poses of the target in the base frame as an instrument at `station` would locate them."""
    p, R = poses
    p = p + np.einsum("nij,nj->ni", R, motion.target[:, :3])
    R = R @ rotations(motion.target[:, 3:])
    F = rotations(motion.frame[:, 3:])
    p = np.einsum("nij,nj->ni", F, (p - station) * (1.0 + motion.scale[:, None])) + station + motion.frame[:, :3]
    return p, F @ R
