"""What users give the robot, as arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.errors import ModelError
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture
from gtpin.real import real
from gtpin.typing import Floats


def like(q: npt.ArrayLike, found: Floats) -> Floats:
    """Results (N, ...) as they are for commands (N, n); the first for one command (n,)."""
    return found if np.ndim(q) == 2 else found[0]


def rows_of(values: npt.ArrayLike, shape: tuple[int, ...], what: str) -> Floats:
    """Values as an array of a shape; `ModelError` where they are no finite numbers, or don't fit."""
    given = real(values, what)
    try:
        found = np.array(np.broadcast_to(given, shape))
    except ValueError:
        found = np.array(np.nan)
    if not np.isfinite(found).all():
        raise ModelError(f"{what} that don't fit {shape[0]} commands", hint=f"give finite numbers of the shape {shape}")
    return found


def wanted(T: Any, R: npt.ArrayLike | None) -> tuple[Floats, Floats | None]:
    """Positions (3,) or (N, 3), and rotations or None, of what :meth:`Robot.inverse` takes."""
    if isinstance(T, ClosedPosture) and T.frame is not None:
        raise ModelError(f"a pose of {T.frame}", hint="give one of the TCP, or load the robot with tcp=")
    if R is None and isinstance(T, (ClosedPosture, Poses)):
        return T.T, T.R
    if R is None and isinstance(T, pin.SE3):
        return np.array(T.translation), np.array(T.rotation)
    wanted = real(T, "wanted poses", "give (3,), (N, 3), (4, 4) or (N, 4, 4) numbers, or a pinocchio.SE3")
    rotations = None if R is None else real(R, "wanted rotations")
    if rotations is None and wanted.ndim in (2, 3) and wanted.shape[-2:] == (4, 4):
        return wanted[..., :3, 3], wanted[..., :3, :3]
    if wanted.ndim not in (1, 2) or wanted.shape[-1] != 3:
        hint = "give (3,), (N, 3), (4, 4) or (N, 4, 4) numbers, or a pinocchio.SE3"
        raise ModelError(f"wanted poses of shape {wanted.shape}", hint=hint)
    if rotations is not None and rotations.shape != (*wanted.shape[:-1], 3, 3):
        hint = "give one 3 x 3 matrix for each position"
        raise ModelError(f"wanted rotations of shape {rotations.shape} for positions {wanted.shape}", hint=hint)
    return wanted, rotations
