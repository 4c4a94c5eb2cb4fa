"""Table I from Table II: the positioning error that closure residuals of the printed size amount to."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from paper_tables import tables

from gtpin.accuracy.expected import ErrorResponse, ExpectedError, Uncertainty, expected_of, response
from gtpin.kinematics.kinematics import reached_poses
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]


def expected_table1(model: Model, q: Floats, draws: int = 2000, seed: int = 0) -> tuple[ExpectedError, ...]:
    """The errors of models 1 to 5 to expect over Gaussian closure residuals of Table II's costs; maxima of 61 poses.

    Parameters
    ----------
    model
        The shipped Gantry-Tau, or a model near it.
    q
        (N, 3) commands of the grid.
    draws, seed
        See :func:`~gtpin.accuracy.expected.expected_of`.
    """
    visits = tables().measurement.calibration_poses
    found = []
    for number in (1, 2, 3, 4, 5):
        sigmas = tables().closure_sigmas(number)
        by = _reduced(model, q, sigmas) if number < 3 else response(model, q, Uncertainty(closures=sigmas))
        found.append(expected_of(by, visits=visits, draws=draws, seed=seed))
    return tuple(found)


def _reduced(model: Model, q: Floats, sigmas: Floats) -> ErrorResponse:
    """Three closures of a platform that does not turn (eqs. 1 to 3): position only.

    Both reduced models' clusters point as model 1's: that of model 2 is printed in another frame.
    """
    kinematics = model.kinematics
    reduced = tables().calibrated[1]
    assert reduced.direction is not None
    T = reached_poses(kinematics, q).T
    d = T[:, None] - reduced.offset - q[..., None] * reduced.direction
    return ErrorResponse(np.zeros((len(q), 3, 0)), np.asarray(np.linalg.inv(d) / 2.0 * sigmas))
