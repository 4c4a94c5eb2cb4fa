"""Poses of the TCP, many at once, and rotations in arrays, by the simulator's own formulas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from gtpin.typing import Floats, Mask

AXES = ("x", "y", "z", "rx", "ry", "rz")
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
    """(2, 3) the unit vectors a and b across a direction (3,), as docs/glossary.md defines those of a track.

    a is the base axis that is least aligned with the direction, less its part along it; b is direction x a.
    """
    a = np.eye(3)[int(np.argmin(np.abs(direction)))]
    a = a - (a @ direction) * direction
    a = a / np.linalg.norm(a)
    (x, y, z), (u, v, w) = direction, a
    return np.array([a, [y * w - z * v, z * u - x * w, x * v - y * u]])


@dataclass(frozen=True)
class VirtualPoses:
    """Positions T (N, 3), m, and rotations R (N, 3, 3) from the TCP frame to a common frame; NaN out of reach.

    ``joints``: coordinates (N,), rad or m, of passive joints that an encoder reads, by name.
    """

    T: Floats
    R: Floats
    joints: Mapping[str, Floats] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.T)

    def __getitem__(self, rows: npt.NDArray[np.generic] | slice) -> VirtualPoses:
        return VirtualPoses(self.T[rows], self.R[rows], {name: x[rows] for name, x in self.joints.items()})

    @property
    def reached(self) -> Mask:
        """(N,) which poses can be reached."""
        return np.isfinite(self.T[:, 0])

    @property
    def quaternions(self) -> Floats:
        """(N, 4) unit quaternions, scalar first, with the signs nearest to the first one; NaN out of reach."""
        wxyz = np.full((len(self), 4), np.nan)
        there = np.flatnonzero(self.reached)
        if there.size:
            found = Rotation.from_matrix(self.R[there]).as_quat(scalar_first=True)
            wxyz[there] = np.where((found @ found[0] < 0.0)[:, None], -found, found)
        return wxyz

    def with_joints(self, joints: Mapping[str, Floats]) -> VirtualPoses:
        """The same poses with the coordinates of some joints."""
        return replace(self, joints=joints)

    def moved(self, T: Floats, R: Floats) -> VirtualPoses:
        """The same poses in another frame, in which the present frame has the position T (3,), m, and rotation R (3, 3)."""
        return VirtualPoses(self.T @ R.T + T, R @ self.R)

    def minus(self, other: VirtualPoses) -> Floats:
        """(N, 6) these poses less others: position, m, and rotation vector, rad, in the common frame; NaN if one is NaN."""
        difference = np.full((len(self), 6), np.nan)
        both = self.reached & other.reached
        difference[both, :3] = self.T[both] - other.T[both]
        difference[both, 3:] = log(self.R[both] @ np.swapaxes(other.R[both], 1, 2))
        return difference

    def change(self, other: VirtualPoses) -> Floats:
        """(N, 6 + k) as :meth:`minus`, followed by the differences of the k joints' coordinates, rad or m."""
        return np.column_stack([self.minus(other), *(x - other.joints[name] for name, x in self.joints.items())])
