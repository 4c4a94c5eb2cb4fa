"""Errors of a fit at poses that are left out of it, each in turn with all its visits."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.left_out_block import LeftOutBlock
from gtpin.typing import Floats

Groups = npt.NDArray[np.intp]

MOST = 2000
"""Largest number of poses that are left out: the root mean square of three components has a relative standard error of 1 %."""
TOGETHER = 500
"""Number of rows whose derivatives are in memory at the same time."""


def left_out(fit: Fit[Any], poses: Groups) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Residuals of linearised fits without the pose of the row, in units of the noise.

    With r the residuals of the rows of one pose, J their derivative by the unknowns and C the covariance of these, the
    residuals of a fit without these rows are (I - J C J')^-1 r.

    ``fit``: the fit to all N rows. ``poses``: (N,) index of each row's pose. All rows of a pose are left out together.

    Returns (N, c) these residuals; zero where the other poses do not determine a number. (N,) mask of the rows for which
    they are computed: of more than 2,000 poses, so many are taken at equal steps.
    """
    count = int(poses.max()) + 1
    taken = np.zeros(count, dtype=bool)
    taken[np.linspace(0, count - 1, min(count, MOST)).round().astype(int)] = True
    some = taken[poses]
    order = np.flatnonzero(some)
    order = order[np.argsort(poses[order], kind="stable")]
    ends = np.append(np.flatnonzero(np.diff(poses[order])) + 1, len(order))
    weight = np.sqrt(np.maximum(fit.weight, 1e-12))[:, None]
    errors, start = np.zeros_like(fit.residual), 0
    while start < len(order):  # as many poses at a time as fit in memory
        stop = int(ends[min(int(np.searchsorted(ends, start + TOGETHER)), len(ends) - 1)])
        rows = order[start:stop]
        jacobian: Floats = fit.problem.jacobian(fit.point, rows, fit.weight[rows])
        half = jacobian @ fit.root
        errors[rows] = of_poses(half, fit.residual[rows] * weight[rows], poses[rows]) / weight[rows]
        start = stop
    return errors, some


def of_poses(half: Floats, left: Floats, poses: Groups) -> Floats:
    """(N, c) residuals without the pose of the row.

    ``half``: (N, c, k) derivative of the whitened numbers by the unknowns, times a root of the unknowns' covariance.
    ``left``: (N, c) whitened residuals of a fit to all rows. ``poses``: (N,) index of each row's pose.
    """
    errors, order = np.zeros_like(left), np.argsort(poses, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(poses[order])) + 1):
        errors[rows] = LeftOutBlock.of(half[rows].reshape(-1, half.shape[2]), left[rows].ravel()).errors.reshape(
            len(rows), -1
        )
    return errors
