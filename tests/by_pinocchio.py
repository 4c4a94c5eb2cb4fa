"""Poses of open chains by Pinocchio alone."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

Floats = np.ndarray


def placed(model: pin.Model, q: Floats, frame: str = "tool0") -> tuple[Floats, Floats]:
    """Positions (N, 3), m, and rotations (N, 3, 3) of a frame at configurations q (N, nq), base frame."""
    data, number = model.createData(), model.getFrameId(frame)
    T, R = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for i, row in enumerate(q):
        pin.framesForwardKinematics(model, data, row)
        T[i], R[i] = data.oMf[number].translation, data.oMf[number].rotation
    return T, R


def torques(model: pin.Model, q: Floats) -> Floats:
    """(N, nv) what gravity asks of the joints at configurations q (N, nq), N m or N."""
    data = model.createData()
    return np.array([pin.computeGeneralizedGravity(model, data, row) for row in q])
