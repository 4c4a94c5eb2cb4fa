"""Serial arms with drawn dimensions and errors, and their measured poses, by Pinocchio alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import gtpin

Floats = np.ndarray
AXES = ("0 0 1", "0 1 0", "0 -1 0", "-1 0 0", "0 -1 0", "-1 0 0")
SPREAD = np.array([1.2, 0.7, 0.8, 1.5, 1.2, 2.0])
"""Largest command of each joint, rad."""


def write_urdf(file: Path, rng: np.random.Generator) -> None:
    """An arm with an elbow and a wrist, with drawn lengths."""
    a, b, c, d, e = rng.uniform(0.1, 0.8, 5)
    shoulder, elbow = rng.choice([0.0, 0.15], 2)
    at = ((0, 0, a), (shoulder, 0, 0), (0, 0, b), (elbow, 0, 0.2 * c), (d, 0, 0), (0.2 * e, 0, 0))
    parts = ['<robot name="arm"><link name="link0"/>']
    for i, (axis, (x, y, z)) in enumerate(zip(AXES, at, strict=True)):
        parts.append(
            f'<link name="link{i + 1}"/><joint name="J{i + 1}" type="revolute"><parent link="link{i}"/>'
            f'<child link="link{i + 1}"/><origin xyz="{x} {y} {z}"/><axis xyz="{axis}"/>'
            '<limit lower="-3.1" upper="3.1" effort="9" velocity="1"/></joint>'
        )
    tool = '<link name="tool0"/><joint name="t" type="fixed"><parent link="link6"/><child link="tool0"/>'
    file.write_text(f'{"".join(parts)}{tool}<origin xyz="0.12 0.03 0.05"/></joint></robot>')


def measured_arm(
    folder: Path, seed: int, *, frame: str = "free", target: str = "free", orientations: bool = False, poses: int = 70
) -> gtpin.Dataset:
    """Poses of an arm whose joints stand 0.4 mm and 0.4 mrad off, with noise of 40 um and 0.1 mrad."""
    rng = np.random.default_rng(seed)
    file = folder / f"arm{seed}.urdf"
    write_urdf(file, rng)
    model = pin.buildModelFromUrdf(str(file))
    for joint in range(1, 7):
        error = pin.SE3(pin.exp3(rng.normal(0, 4e-4, 3)), rng.normal(0, 4e-4, 3))
        model.jointPlacements[joint] = model.jointPlacements[joint] * error
    data, tool = model.createData(), model.getFrameId("tool0")
    view = pin.SE3(Rotation.random(random_state=rng).as_matrix(), rng.normal(0, 2, 3))
    stand = view if frame == "free" else pin.SE3.Identity()
    q = rng.uniform(-1, 1, (poses, 6)) * SPREAD
    T, R = np.empty((poses, 3)), np.empty((poses, 3, 3))
    for i, row in enumerate(q):
        pin.framesForwardKinematics(model, data, row)
        seen = stand * data.oMf[tool]
        T[i], R[i] = seen.translation, seen.rotation @ pin.exp3(rng.normal(0, 1e-4, 3))
    wxyz = Rotation.from_matrix(R).as_quat(scalar_first=True) if orientations else None
    names = [f"p{i}" for i in range(poses)]
    known = {"frame": frame, "target": target}
    return gtpin.Dataset(str(file), names, q, T + rng.normal(0, 4e-5, T.shape), wxyz, instrument=known)
