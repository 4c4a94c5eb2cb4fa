"""A first guess of a target's place on the platform, by a closed-form fit of nominal and measured poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.spatial.transform import Rotation

from gtpin.calibration.checks.actuators import check_actuators
from gtpin.calibration.problem import Measured, measured_poses
from gtpin.data import Dataset
from gtpin.data.plausible import misplaced
from gtpin.data.quaternion_order import in_order, order_that_fits
from gtpin.data.sane import sane_rows
from gtpin.errors import DatasetError
from gtpin.kinematics.kinematics import kinematics
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import log
from gtpin.robot.geometry import Geometry

Floats = npt.NDArray[np.float64]

POSITION, ROTATION = 0.05, 0.1
"""Tolerances, m and rad, of a free target about its first guess. The error of the guess is that of the robot: millimetres."""
ANY_ROTATION = 2.0
"""The same, rad, where orientations were not measured: then no rotation is preferred."""
FEWEST, ROWS = 6, 100
"""Smallest and largest number of poses from which the order of quaternions is determined."""
ROUNDS = 30
"""Number of alternating fits of the frame and the target, each with new weights."""


def with_free_target(geometry: Geometry, dataset: Dataset) -> Geometry:
    """The geometry with the TCP moved to a first guess of the target and with wide tolerances, if the dataset's target is free.

    Raises
    ------
    DatasetError
        If the robot has rods, for which these parameters do not exist; if it has another number of actuators; or if the
        measured quaternions fit a target on the platform only in another order of their numbers.
    """
    if dataset.instrument.target != "free":
        return geometry
    if geometry.robot.rods:
        hint = "leave target out: the joints on the platform are identified with it"
        raise DatasetError(
            "a free target of a robot with rods", file=dataset.file, column="instrument.target", hint=hint
        )
    check_actuators(geometry.robot, dataset)
    rows = sane_rows(dataset)
    measured = measured_poses(dataset.take(rows))
    poses = kinematics(geometry).forward(measured.q)
    good = poses.reached
    poses, measured, free_frame = poses[good], measured.take(good), dataset.instrument.frame == "free"
    if (order := _misplaced_order(poses, measured, free_frame)) is not None:
        raise misplaced(dataset, order)
    guess = pin.log6(target_on_platform(poses, measured, free_frame=free_frame))
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


def _misplaced_order(predicted: Poses, measured: Measured, free_frame: bool) -> str | None:
    """The order of the numbers of quaternions, where it is not wxyz: that with which a target on the platform fits best.

    Distances are converted to angles by division by the size of the workspace. They are needed because, where the robot turns
    about one axis only, a free target can compensate an inverted rotation.
    """
    if measured.R is None or len(predicted) < FEWEST:
        return None
    some = np.linspace(0, len(predicted) - 1, min(len(predicted), ROWS)).astype(int)
    predicted, measured = predicted[some], measured.take(some)
    assert measured.R is not None
    quaternion = Rotation.from_matrix(measured.R.copy()).as_quat(scalar_first=True)
    size = max(float(np.linalg.norm(predicted.T - predicted.T.mean(axis=0), axis=1).mean()), 1e-6)

    def off(order: str) -> float:
        R = Rotation.from_quat(in_order(quaternion, order), scalar_first=True).as_matrix()
        read = Measured(measured.q, measured.T, R)
        F, X = _turned(predicted.R, R, free_frame)
        t = target_on_platform(predicted, read, free_frame=free_frame).translation
        at = (predicted.T + predicted.R @ t) @ F.T
        left = measured.T - at - (np.median(measured.T - at, axis=0) if free_frame else 0.0)
        turns = np.linalg.norm(log(np.swapaxes(F @ predicted.R @ X, 1, 2) @ R), axis=1)
        return float(np.median(turns) + np.median(np.linalg.norm(left, axis=1)) / size)

    return order_that_fits(off)


def target_on_platform(predicted: Poses, measured: Measured, *, free_frame: bool) -> pin.SE3:
    """Placement X of the target in the TCP frame, from measured = F predicted X with F the identity or free.

    Alternating least squares from two first guesses; poses with large errors have little weight. Without measured
    orientations the target's rotation is not determined, and is set to the identity.

    Parameters
    ----------
    predicted
        (N) poses of the TCP, base frame.
    measured
        (N) poses of the target, instrument's frame.
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
    """Rotation and shift, m, of the instrument's frame from positions (Kabsch); ``known``: the rotation, from orientations."""
    a, b = np.average(at, axis=0, weights=w), np.average(T, axis=0, weights=w)
    R = _nearest((w[:, None] * (T - b)).T @ (at - a)) if known is None else known
    return R, b - R @ a


def _nearest(matrix: Floats) -> Floats:
    """The rotation that is nearest to a matrix (3, 3)."""
    U, _, Vt = np.linalg.svd(matrix)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


def _turned(R: Floats, seen: Floats, free_frame: bool) -> tuple[Floats, Floats]:
    """Rotations F and X with seen = F R X: from the nearest Kronecker product (Van Loan and Pitsianis 1993), then by
    alternating fits."""
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
    """(3,) first guess of the target t, TCP frame, m, from positions alone: T = F predicted.T + F predicted.R t + shift.

    This is linear in F and in the products of the numbers of F and t. All are fitted as if they were independent, then t is
    found from the products.
    """
    rows = np.hstack([predicted.T, predicted.R.reshape(-1, 9), np.ones((len(T), 1))])
    found = np.asarray(np.linalg.lstsq(rows, T, rcond=None)[0].T, dtype=np.float64)
    # (3, 13): for each row of F its three numbers, their nine products with t, and the shift.
    F = _nearest(found[:, :3])
    products = found[:, 3:12].reshape(3, 3, 3)
    return np.asarray(np.einsum("ab,abc->c", F, products) / 3.0)
