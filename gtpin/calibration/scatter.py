"""Whether apparent scatter of the drives is independent from pose to pose (repeatability), or a model error.

Errors of repeatability are independent at every pose. A model error (a bent track, a rack, compliant links) is a function of
the commands, so that neighbouring poses have similar errors. Rao's score test of the second against the first is a
weighted sum of products of neighbouring poses' scores, Moran's I of regression residuals in its general form: P. Burridge,
"On the Cliff-Ord test for spatial autocorrelation", J. R. Statist. Soc. B 42 (1980) 107-108. Its mean and variance under
independence are those of a quadratic form in the residuals of a regression: A. D. Cliff and J. K. Ord, "Testing for spatial
autocorrelation among regression residuals", Geographical Analysis 4 (1972) 267-284.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import cdist

from gtpin.calibration.problem import Point, Problem
from gtpin.distributions import norm
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats

ENOUGH = 1000
"""Number of poses among which neighbours are searched; more are slower, and hardly more accurate."""
CHANCE = 0.025
"""Probability of calling independent scatter correlated; equal to that of accepting a repeatability that does not exist.
Assumed."""


def independent(
    whole: Problem, point: Point, noise: ReadingNoise, used: npt.NDArray[np.bool_], by_command: Floats
) -> bool:
    """Whether the residuals along the motions of single drives are independent from pose to pose, as repeatability is.

    ``whole``: the problem with all N rows. ``point``: result of a fit. ``noise``: the noise of all rows, including the
    repeatability to be tested. ``used``: (N,) the rows that are not gross errors. ``by_command``: (N, c, n) derivative of
    the measured numbers by the commands.
    """
    rows = np.flatnonzero(used)
    some = rows[:: 1 + (len(rows) - 1) // ENOUGH]
    J = by_command[some]
    problem = whole.take(some, noise.take(some).whitening(J, J.shape[1]))
    x = point.x.copy()
    x[: problem.n_geometry] = 0.0  # unknowns of the instruments from the fit; geometry from nominal
    z = _scores(problem, problem.point(x), J)
    return max(z) < float(norm.isf(CHANCE / len(z)))


def _scores(problem: Problem, point: Point, J: Floats) -> list[float]:
    """Standard scores of the correlation of the drives' errors at neighbouring poses, one for each kind of neighbour."""
    B = np.concatenate([problem.jacobian(point, rows) for rows in problem.chunks()])
    k = B.shape[2]
    y = problem.residual(point) + B @ point.x
    flat = B.reshape(-1, k)
    C = np.linalg.inv(flat.T @ flat + np.diag(problem.prior))
    left = y - B @ (C @ (flat.T @ y.ravel()))  # of covariance I - B C B' where the errors are independent
    D = problem.whitening @ J
    score = np.einsum("nci,nc->ni", D, left)
    S, G = np.swapaxes(D, 1, 2) @ B, np.swapaxes(D, 1, 2) @ D
    found = []
    for kernel in _neighbours(problem.measured.q):
        drives = range(len(kernel))
        KS = np.stack([kernel[i] @ S[:, i] for i in drives], axis=1)
        A, AA = np.einsum("nik,nil->kl", S, KS), np.einsum("nik,nij,njl->kl", KS, G, KS, optimize=True)
        squares = sum(float(G[:, i, j] @ (kernel[i] * kernel[j]) @ G[:, j, i]) for i in drives for j in drives)
        variance = 2.0 * (squares - 2.0 * np.trace(C @ AA) + np.trace(C @ A @ C @ A))
        total = sum(float(score[:, i] @ kernel[i] @ score[:, i]) for i in drives)
        found.append(float((total + np.trace(C @ A)) / np.sqrt(max(variance, 1e-300))))
    return found


def _neighbours(q: Floats) -> list[Floats]:
    """(n, N, N) weights of each pair of poses for each drive, for two kinds of neighbours: near in all commands, or in its own.

    A weight is a Gaussian of the distance, with the median distance of a pose to its nearest neighbour as standard deviation.
    """
    unit = q / np.maximum(np.std(q, axis=0), 1e-12)
    apart = cdist(unit, unit)
    np.fill_diagonal(apart, np.inf)
    near = max(float(np.median(apart.min(axis=1))), 1e-12)
    all_ = np.exp(-0.5 * (apart / near) ** 2)
    own = np.exp(-0.5 * ((unit.T[:, :, None] - unit.T[:, None, :]) / near) ** 2)
    own[:, np.arange(len(q)), np.arange(len(q))] = 0.0
    return [np.broadcast_to(all_, own.shape), own]
