"""Information on the geometry from measurements at planned poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.calibration.observability import Observability, observability
from gtpin.kinematics.kinematics import reached_poses
from gtpin.kinematics.rotations import skew
from gtpin.model.model import Model, in_frame
from gtpin.noise.noise import Noise
from gtpin.typing import Floats

Rows = npt.NDArray[np.intp]

FREE = 1.0
"""Prior sigma of an instrument's pose that is not known, m and rad."""


@dataclass(frozen=True)
class Signal:
    """Information from poses: derivatives of their whitened measurements by standard normal unknowns.

    ``B``: (N, c, size) derivatives of the c whitened numbers of each pose: by the geometry in units of the tolerances, then
    by the pose of a free instrument in units of ``FREE``. ``names``: names of the geometry's p parameters.
    """

    B: Floats
    names: tuple[str, ...]

    def information(self, rows: Rows | None = None) -> Floats:
        """(size, size) B'B summed over the poses ``rows``; None: over all."""
        B = self.B if rows is None else self.B[rows]
        flat = B.reshape(-1, B.shape[2])
        return np.asarray(flat.T @ flat)

    def nats(self, rows: Rows | None = None) -> float:
        """log det(I + B'B), which D-optimal poses maximise: twice the mutual information of measurements and unknowns, nats."""
        information = self.information(rows)
        return float(np.linalg.slogdet(np.eye(len(information)) + information)[1])

    def covariance(self, rows: Rows | None = None) -> Floats:
        """(p, p) covariance of the geometry after measuring, in units of the tolerances."""
        information = self.information(rows)
        p = len(self.names)
        return np.asarray(np.linalg.inv(np.eye(len(information)) + information)[:p, :p])

    def variance_reduction(self, rows: Rows | None = None) -> Floats:
        """(p,) variance reduction of each parameter by measuring."""
        return np.asarray(1.0 - np.diag(self.covariance(rows)))

    def observability(self, rows: Rows | None = None) -> Observability:
        """Observability by measuring: variance reduction by direction, and the indices O1 to O5."""
        B = self.B if rows is None else self.B[rows]
        p, size = len(self.names), self.B.shape[2]
        free = np.eye(size)[p:]  # the instrument's pose has a prior here, so that few poses give information too
        return observability(np.vstack([B.reshape(-1, size), free]), p, B.shape[0] * B.shape[1])


def signal(model: Model, q: Floats, noise: Noise, *, orientation: bool = True, free_frame: bool = False) -> Signal:
    """Information from measuring at commands q (N, n), with the geometry's tolerances as priors.

    ``noise``: noise of the poses. Where it has a line of sight, this must be that of the same poses. ``orientation``:
    whether orientations are measured too. ``free_frame``: whether the instrument's pose is identified too.

    Raises `UnreachableError` if the commands can't be reached.
    """
    kinematics = model.kinematics
    poses = reached_poses(kinematics, q)
    components = 6 if orientation else 3
    J = kinematics.geometry_jacobian(q, poses)[:, :6] * model.geometry.tolerance
    J = in_frame(J, model.frame)
    if free_frame:
        motion = np.zeros((len(q), 6, 6))
        motion[:, :3, :3] = motion[:, 3:, 3:] = FREE * np.eye(3)
        seen = model.seen(poses).T
        motion[:, :3, 3:] = -FREE * skew(seen - seen.mean(axis=0))
        J = np.concatenate([J, motion], axis=2)
    whitening = noise.whitening(in_frame(kinematics.command_jacobian(q, poses)[:, :6], model.frame), components)
    return Signal(whitening @ J[:, :components], model.geometry.names)
