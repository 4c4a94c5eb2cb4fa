"""What a linear fit without a block predicts of it, from the fit of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

LOST = 1e-6
"""Least variance of a number's noise over that of its prediction by the other numbers: a prediction that is off by more than a
thousand sigmas is none, such as that of a socket's point by readings of other sockets. A stated assumption; a prior of 1 m and
noise of 20 um give less than 1e-9, a tolerance of 0.5 mm gives some 1e-4."""


@dataclass(frozen=True)
class Block:
    """Residuals of r numbers of a block from the fit of all others.

    Parameters
    ----------
    errors
        (r,) (I - H)^-1 left, H = half half' being the block's leverage and ``left`` its residual from the fit of all, without
        directions that the others can't predict.
    kept
        (r,) share of each number that the others can predict.
    log_density
        Log density of the block given the others, without the constant.
    """

    errors: Floats
    kept: Floats
    log_density: float

    @staticmethod
    def of(half: Floats, left: Floats) -> Block:
        """The block of some rows.

        Parameters
        ----------
        half
            (r, k) derivative of the block's numbers by what was fitted, times a root of its covariance.
        left
            (r,) residual of the fit of all.
        """
        if len(half) <= half.shape[1]:
            w, V = np.linalg.eigh(np.eye(len(half)) - half @ half.T)
            good = w > LOST
            along = V[:, good].T @ left
            errors, lost = V[:, good] @ (along / w[good]), V[:, ~good]
        else:
            # The same by Woodbury's identity: a session has thousands of rows, and the fit a few hundred coefficients.
            w, U = np.linalg.eigh(np.eye(half.shape[1]) - half.T @ half)
            good = w > LOST
            lost = half @ U[:, ~good] / np.sqrt(1.0 - w[~good])
            seen = half @ U[:, good]
            errors = left - lost @ (lost.T @ left) + seen @ ((seen.T @ left) / w[good])
        density = 0.5 * (float(np.log(w[good]).sum()) - float(left @ errors))
        return Block(errors, 1.0 - (lost**2).sum(axis=1), density)
