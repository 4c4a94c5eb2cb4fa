"""The pose of a frame from the best fit of poses to measured ones, robust against gross errors."""

from __future__ import annotations

import numpy as np

from gtpin.kinematics.poses import Poses
from gtpin.typing import Floats

ALIGNMENTS = 20
"""Number of fits, each with new weights of the poses. Assumed."""


def alignment(poses: Poses, T: Floats, R: Floats | None) -> tuple[Floats, Floats]:
    """Position (3,), m, and rotation (3, 3) of the frame of poses in the frame of measured positions and rotations.

    By least squares from a singular value decomposition (Kabsch 1976), of the positions T (N, 3), m, and, where given, of the
    rotations R (N, 3, 3). Gross errors have little weight.
    """
    far = np.linalg.norm(T - np.median(T, axis=0), axis=1)
    weight = (far <= 10.0 * np.median(far)).astype(float)
    for _ in range(ALIGNMENTS):
        shift, turn = _aligned(poses, T, R, weight)
        off = np.linalg.norm(T - poses.moved(shift, turn).T, axis=1)
        weight = 1.0 / np.maximum(off / max(float(np.median(off)), 1e-9), 1.0)
    return shift, turn


def _aligned(poses: Poses, T: Floats, R: Floats | None, weight: Floats) -> tuple[Floats, Floats]:
    w = weight / weight.sum()
    centre_a, centre_b = w @ poses.T, w @ T
    a, b = poses.T - centre_a, T - centre_b
    # Orientations determine the rotation even if positions don't; 1 m of position counts as much as 1 rad.
    turns = np.zeros((3, 3)) if R is None else np.einsum("n,nij,nkj->ik", w, R, poses.R)
    U, _, Vt = np.linalg.svd((w[:, None] * b).T @ a + turns)
    turn = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return centre_b - turn @ centre_a, turn
