"""A first guess of where a target sits on the platform, by a closed-form fit of nominal and measured poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.calibration.problem import Measured, measured_poses
from gtpin.data import Dataset
from gtpin.data.sane import sane_rows
from gtpin.errors import DatasetError
from gtpin.kinematics.kinematics import kinematics
from gtpin.kinematics.poses import Poses
from gtpin.robot.geometry import Geometry

Floats = npt.NDArray[np.float64]

POSITION, ROTATION = 0.05, 0.1
"""Tolerances, m and rad, of a free target about its first guess, whose own error is that of the robot: millimetres."""
ANY_ROTATION = 2.0
"""The same, rad, where orientations were not measured: any rotation is as good."""
ROUNDS = 30
"""Alternating fits of the frame and the target, each with new weights."""


def with_free_target(geometry: Geometry, dataset: Dataset) -> Geometry:
    """The geometry with the TCP where the target must sit, and its tolerances wide, if the dataset says that it is free.

    Raises
    ------
    DatasetError
        If the robot has rods, whose platform carries no such parameters.
    """
    if dataset.instrument.target != "free":
        return geometry
    if geometry.robot.rods:
        hint = "leave target out: the joints on the platform are identified with it"
        raise DatasetError(
            "a free target of a robot with rods", file=dataset.file, column="instrument.target", hint=hint
        )
    rows = sane_rows(dataset)
    measured = measured_poses(dataset.take(rows))
    poses = kinematics(geometry).forward(measured.q)
    good = poses.reached
    guess = pin.log6(
        target_on_platform(poses[good], measured.take(good), free_frame=dataset.instrument.frame == "free")
    )
    values, parameters = geometry.values.copy(), []
    for i, p in enumerate(geometry.parameters):
        if p.kind == "platform":
            values[i] = guess.vector[p.component]
            turn = ANY_ROTATION if measured.R is None else ROTATION
            tolerance = POSITION if p.component < 3 else turn
            parameters.append(replace(p, nominal=float(values[i]), tolerance=tolerance))
        else:
            parameters.append(p)
    return Geometry(geometry.robot, tuple(parameters), values)


def target_on_platform(predicted: Poses, measured: Measured, *, free_frame: bool) -> pin.SE3:
    """Placement X of the target in the TCP frame, from measured = F predicted X with F the identity or free.

    Alternating least squares from two first guesses; poses that are far off have little weight. Without measured
    orientations the target's rotation can't be told, and is none.

    Parameters
    ----------
    predicted
        (N) poses of the TCP, base frame.
    measured
        (N) of the target, instrument's frame.
    """
    weight = np.ones(len(predicted))
    F, X = np.eye(3), np.eye(3)
    if measured.R is not None:
        F, X = _turned(predicted.R, measured.R, free_frame)
    starts = [np.zeros(3)]
    if free_frame and measured.R is None and len(predicted) >= 14:
        starts.append(_bilinear(predicted, measured.T))
    best, least = pin.SE3.Identity(), np.inf
    for t in starts:
        turn, w = F, weight
        for _ in range(ROUNDS):
            at = predicted.T + predicted.R @ t
            shift = np.zeros(3)
            if free_frame:
                turn, shift = _frame(at, measured.T, w, None if measured.R is None else F)
            A = turn @ predicted.R
            left = measured.T - (predicted.T @ turn.T + shift)
            if free_frame:  # the frame's shift is free as well: fit both at once
                A, left = A - np.average(A, axis=0, weights=w), left - np.average(left, axis=0, weights=w)
            root = np.sqrt(w)[:, None]
            whole, right = (root[..., None] * A).reshape(-1, 3), (root * left).ravel()
            t = np.asarray(np.linalg.lstsq(whole, right, rcond=None)[0], dtype=np.float64)
            off = np.linalg.norm(left - A @ t, axis=1)
            w = 1.0 / np.maximum(off / max(float(np.median(off)), 1e-9), 1.0)
        if (cost := float(np.median(off))) < least:
            best, least = pin.SE3(X, t), cost
    return best


def _frame(at: Floats, T: Floats, w: Floats, known: Floats | None) -> tuple[Floats, Floats]:
    """Rotation and shift of the instrument's frame: Kabsch, or with the rotation that orientations gave."""
    a, b = np.average(at, axis=0, weights=w), np.average(T, axis=0, weights=w)
    R = _nearest((w[:, None] * (T - b)).T @ (at - a)) if known is None else known
    return R, b - R @ a


def _nearest(matrix: Floats) -> Floats:
    """The rotation that is nearest to a matrix (3, 3)."""
    U, _, Vt = np.linalg.svd(matrix)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


def _turned(R: Floats, seen: Floats, free_frame: bool) -> tuple[Floats, Floats]:
    """Rotations F and X with seen = F R X: from the nearest Kronecker product, then by alternating fits."""
    F = np.eye(3)
    if free_frame:
        # vec(F R X) = (F kron X') vec(R), rows stacked: the matrix by least squares, its factors by a singular vector.
        flat, other = R.reshape(-1, 9), seen.reshape(-1, 9)
        matrix = np.linalg.lstsq(flat, other, rcond=None)[0].T
        parts = matrix.reshape(3, 3, 3, 3).transpose(0, 2, 1, 3).reshape(9, 9)
        first = np.linalg.svd(parts)[0][:, 0].reshape(3, 3)
        F = _nearest(first * np.sign(np.linalg.det(first)))
    X = np.eye(3)
    weight = np.ones(len(R))
    for _ in range(ROUNDS):
        X = _nearest(np.einsum("n,nji,njk->ik", weight, F @ R, seen))
        if free_frame:
            F = _nearest(np.einsum("n,nij,nkj->ik", weight, seen, R @ X))
        angle = np.linalg.norm(seen - F @ R @ X, axis=(1, 2))
        weight = 1.0 / np.maximum(angle / max(float(np.median(angle)), 1e-9), 1.0)
    return F, X


def _bilinear(predicted: Poses, T: Floats) -> Floats:
    """(3,) the target from positions: F and F t e' as if they were independent, then the nearest t."""
    rows = np.hstack([predicted.T, predicted.R.reshape(-1, 9), np.ones((len(T), 1))])
    found = np.asarray(np.linalg.lstsq(rows, T, rcond=None)[0].T, dtype=np.float64)
    # (3, 13): for each row a of F its own three numbers, nine products with t, and the shift.
    F = _nearest(found[:, :3])
    products = found[:, 3:12].reshape(3, 3, 3)
    return np.asarray(np.einsum("ab,abc->c", F, products) / 3.0)
