"""Which links' costs peak where the position error peaks: the point of the paper's Fig. 9."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from paper_tables import tables
from scipy.stats import rankdata

from gtpin.accuracy.expected import closure_response
from gtpin.kinematics.kinematics import reached_poses
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]


def peak_ranks(model: Model, q: Floats, draws: int = 500, seed: int = 0) -> Floats:
    """(k,) where each link's cost ranks at the pose of the largest position error: 1 the largest, 0.5 by chance, 0 the least.

    Means over sets of 61 poses with Gaussian closure residuals of model 5's printed costs.

    Parameters
    ----------
    q
        (N, n) commands of the grid.
    """
    rng = np.random.default_rng(seed)
    kinematics = model.kinematics
    response = closure_response(kinematics, q, reached_poses(kinematics, q))[:, :3]
    sigmas, visits = tables().closure_sigmas(5), tables().measurement.calibration_poses
    ranks = []
    for _ in range(draws):
        rows = rng.permutation(len(q))[:visits]
        residual = sigmas * rng.standard_normal((len(rows), len(sigmas)))
        error = np.linalg.norm(np.einsum("nij,nj->ni", response[rows], residual), axis=1)
        ranks.append((rankdata(residual**2, axis=0)[int(np.argmax(error))] - 1.0) / (len(rows) - 1.0))
    return np.asarray(np.mean(ranks, axis=0))
