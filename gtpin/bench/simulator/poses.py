"""Poses of the TCP, many at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from gtpin.bench.simulator.rotations import log
from gtpin.typing import Floats


@dataclass(frozen=True)
class Poses:
    """Positions T (N, 3), m, and rotations R (N, 3, 3) from the TCP frame to a common frame; NaN out of reach.

    ``joints``: coordinates (N,), rad or m, of passive joints that an encoder reads, by name.
    """

    T: Floats
    R: Floats
    joints: Mapping[str, Floats] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.T)

    def __getitem__(self, rows: npt.NDArray[np.generic] | slice) -> Poses:
        return Poses(self.T[rows], self.R[rows], {name: x[rows] for name, x in self.joints.items()})

    @property
    def reached(self) -> npt.NDArray[np.bool_]:
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

    def with_joints(self, joints: Mapping[str, Floats]) -> Poses:
        """The same poses with the coordinates of some joints."""
        return replace(self, joints=joints)

    def moved(self, T: Floats, R: Floats) -> Poses:
        """The same poses in another frame, in which the present frame has the position T (3,), m, and rotation R (3, 3)."""
        return Poses(self.T @ R.T + T, R @ self.R)

    def minus(self, other: Poses) -> Floats:
        """(N, 6) these poses less others: position, m, and rotation vector, rad, in the common frame; NaN if one is NaN."""
        difference = np.full((len(self), 6), np.nan)
        both = self.reached & other.reached
        difference[both, :3] = self.T[both] - other.T[both]
        difference[both, 3:] = log(self.R[both] @ np.swapaxes(other.R[both], 1, 2))
        return difference

    def change(self, other: Poses) -> Floats:
        """(N, 6 + k) as :meth:`minus`, followed by the differences of the k joints' coordinates, rad or m."""
        return np.column_stack([self.minus(other), *(x - other.joints[name] for name, x in self.joints.items())])
