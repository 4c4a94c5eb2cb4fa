"""Errors of a fit at poses that are left out of it, each in turn with all its visits."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.gauss_newton import Fit
from gtpin.typing import Floats, Indices, Mask

LEAST_DETERMINED = 1e-6
"""Smallest ratio of a number's noise variance to the variance of its prediction from the other blocks. Below it, the other
blocks do not determine the number: readings of other sockets, for example, do not determine the position of a socket. Assumed:
with noise of 20 um, a prior of 1 m gives less than 1e-9, and a tolerance of 0.5 mm gives about 1e-4."""

MOST_LEFT_OUT = 2000
"""Largest number of poses that are left out: the root mean square of three components has a relative standard error of 1 %."""


def left_out(fit: Fit) -> tuple[Floats, Mask]:
    """Errors of linearised fits without the pose of the row: without all rows of its commands.

    With r the residuals of the rows of one pose, J their derivative by the unknowns and C the covariance of these, the
    residuals of a fit without these rows are (I - J C J')^-1 r.

    ``fit``: the fit to all N rows.

    Returns (M, c) errors, m and rad; zero where the other poses do not determine a number. (N,) mask of the M rows for which
    they are computed: of more than 2,000 poses, so many are taken at equal steps.
    """
    poses = np.unique(fit.problem.measured.q, axis=0, return_inverse=True)[1].ravel()
    count = int(poses.max()) + 1
    taken = np.zeros(count, dtype=bool)
    taken[np.linspace(0, count - 1, min(count, MOST_LEFT_OUT)).round().astype(int)] = True
    some = taken[poses]
    order = np.flatnonzero(some)
    order = order[np.argsort(poses[order], kind="stable")]
    ends = np.append(np.flatnonzero(np.diff(poses[order])) + 1, len(order))
    weight = np.sqrt(np.maximum(fit.weight, 1e-12))[:, None]
    errors, start = np.zeros_like(fit.residual), 0
    while start < len(order):  # as many poses at a time as fit in memory
        stop = int(ends[min(int(np.searchsorted(ends, start + 500)), len(ends) - 1)])
        rows = order[start:stop]
        jacobian: Floats = fit.problem.jacobian(fit.point, rows, fit.weight[rows])
        half = jacobian @ fit.root
        errors[rows] = of_poses(half, fit.residual[rows] * weight[rows], poses[rows]) / weight[rows]
        start = stop
    return np.asarray(np.linalg.solve(fit.problem.whitening[some], errors[some][..., None])[..., 0]), some


def of_poses(half: Floats, residual: Floats, poses: Indices) -> Floats:
    """(N, c) residuals without the pose of the row.

    ``half``: (N, c, k) derivative of the whitened numbers by the unknowns, times a root of the unknowns' covariance.
    ``residual``: (N, c) whitened residuals of a fit to all rows. ``poses``: (N,) index of each row's pose.
    """
    errors, order = np.zeros_like(residual), np.argsort(poses, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(poses[order])) + 1):
        block, _ = of_block(half[rows].reshape(-1, half.shape[2]), residual[rows].ravel())
        errors[rows] = block.reshape(len(rows), -1)
    return errors


def of_block(half: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Residuals of the r numbers of a block from a fit to all other numbers, and the share of each that these determine.

    The residuals are (r,) (I - H)^-1 residual with H = half half', the block's leverage, without the directions that the other
    numbers do not determine.

    ``half``: (r, k) derivative of the block's numbers by what was fitted, times a root of its covariance. ``residual``: (r,)
    residual of the fit of all.
    """
    if len(half) <= half.shape[1]:
        w, V = np.linalg.eigh(np.eye(len(half)) - half @ half.T)
        good = w > LEAST_DETERMINED
        along = V[:, good].T @ residual
        errors, lost = V[:, good] @ (along / w[good]), V[:, ~good]
    else:
        # The same by Woodbury's identity: a session has thousands of rows, and the fit a few hundred coefficients.
        w, U = np.linalg.eigh(np.eye(half.shape[1]) - half.T @ half)
        good = w > LEAST_DETERMINED
        lost = half @ U[:, ~good] / np.sqrt(1.0 - w[~good])
        seen = half @ U[:, good]
        errors = residual - lost @ (lost.T @ residual) + seen @ ((seen.T @ residual) / w[good])
    return errors, 1.0 - (lost**2).sum(axis=1)
