"""Errors of a fit at poses that are left out of it, each in turn with all its visits, and what is unexplained between poses."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.left_out_block import Block
from gtpin.calibration.settled import LACK_OF_FIT
from gtpin.distributions import chi2, f
from gtpin.model.unexplained import Unexplained
from gtpin.typing import Floats

Groups = npt.NDArray[np.intp]

MOST = 2000
"""Largest number of poses that are left out: the root mean square of three components has a relative standard error of 1 %."""
TOGETHER = 500
"""Number of rows whose derivatives are in memory at the same time."""


def poses_of(*columns: npt.NDArray[np.generic]) -> Groups:
    """(N,) index of each row's pose: rows with the same commands (N, n) are visits of one pose."""
    return np.unique(np.column_stack(columns), axis=0, return_inverse=True)[1].ravel()


def left_out(fit: Fit[Any], poses: Groups) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Residuals of linearised fits without the pose of the row, in units of the noise.

    With r the residuals of the rows of one pose, J their derivative by the unknowns and C the covariance of these, the
    residuals of a fit without these rows are (I - J C J')^-1 r.

    Parameters
    ----------
    fit
        The fit to all N rows.
    poses
        (N,) index of each row's pose. All rows of a pose are left out together.

    Returns
    -------
    errors, some
        (N, c) these residuals; zero where the other poses do not determine a number. (N,) mask of the rows for which they are
        computed: of more than 2,000 poses, so many are taken at equal steps.
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

    Parameters
    ----------
    half
        (N, c, k) derivative of the whitened numbers by the unknowns, times a root of the unknowns' covariance.
    left
        (N, c) whitened residuals of a fit to all rows.
    poses
        (N,) index of each row's pose.
    """
    errors, order = np.zeros_like(left), np.argsort(poses, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(poses[order])) + 1):
        errors[rows] = Block.of(half[rows].reshape(-1, half.shape[2]), left[rows].ravel()).errors.reshape(len(rows), -1)
    return errors


def unexplained(
    errors: Floats,
    whitened: Floats,
    variance: Floats,
    places: Groups,
    turns: npt.NDArray[np.bool_],
    taken: float,
    *,
    known: bool,
    dof: float = np.inf,
) -> Unexplained:
    """What a fit leaves unexplained between poses: the scatter of the poses' mean residuals beyond that of the noise.

    Repeated visits of a pose show the noise, and not whether the model is right at this pose. So a number of a pose counts
    once, with the mean of its visits, and the degrees of freedom are the count of these means less the parameters that were
    fitted.
    One standard deviation of the mean square is added. Where chi-square shows no unexplained errors, they are 0.

    Parameters
    ----------
    errors, whitened
        (M,) residuals of the fit, m or rad, and in units of the noise, one for each measured number.
    variance
        (M,) variance of the noise of each number, m^2 or rad^2.
    places
        (M,) index of each number's pose and component: equal for the repeated visits of a pose.
    turns
        (M,) whether the number is an angle.
    taken
        Effective number of fitted parameters.
    known
        Whether the noise was declared, or repeated visits showed it. Otherwise all residuals count as unexplained.
    dof
        Degrees of freedom of the noise; infinite where it was declared.
    """
    visits = np.bincount(places)
    own = np.unique(places, return_index=True)[1]  # one number of each pose and component
    means, noise, whole = (
        np.bincount(places, x)[places[own]] / visits[places[own]] for x in (errors, variance, whitened)
    )
    free = max(len(own) - taken, 1.0)
    power = float((visits[places[own]] * whole**2).sum())
    if known:
        chance = chi2.sf(power, free) if np.isinf(dof) else f.sf(power / free, free, dof)
        if chance >= LACK_OF_FIT:
            return Unexplained(0.0, 0.0)

    def size(some: npt.NDArray[np.bool_]) -> float:
        if not some.any():
            return 0.0
        seen = float((means[some] ** 2).mean()) * len(own) / free * (1.0 + np.sqrt(2.0 / free))
        random = float((noise[some] / visits[places[own]][some]).mean()) if known else 0.0
        return float(np.sqrt(max(seen - random, 0.0)))

    return Unexplained(size(~turns[own]), size(turns[own]), known)


def unexplained_poses(
    fit: Fit[Any], errors: Floats, variance: Floats, poses: Groups, *, known: bool, dof: float = np.inf
) -> Unexplained:
    """What a fit of measured poses leaves unexplained: see :func:`unexplained`.

    Parameters
    ----------
    fit
        The fit to N poses with c = 3 or 6 components.
    errors
        (N, c) its residuals, m and rad.
    variance
        (N, c) variance of the noise, m^2 and rad^2.
    poses
        (N,) index of each row's pose.
    known, dof
        As for :func:`unexplained`.
    """
    c = errors.shape[1]
    places = (poses[:, None] * c + np.arange(c)).ravel()
    turns = np.broadcast_to(np.arange(c) >= 3, errors.shape).ravel()
    return unexplained(
        errors.ravel(), fit.residual.ravel(), variance.ravel(), places, turns, fit.taken, known=known, dof=dof
    )
