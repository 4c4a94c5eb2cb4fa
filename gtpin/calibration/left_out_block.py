"""Predictions of a left-out block by a linear fit without it, computed from the fit of all rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.typing import Floats

LOST = 1e-6
"""Smallest ratio of a number's noise variance to the variance of its prediction from the other blocks. Below it, the other
blocks do not determine the number: readings of other sockets, for example, do not determine the position of a socket. Assumed:
with noise of 20 um, a prior of 1 m gives less than 1e-9, and a tolerance of 0.5 mm gives about 1e-4."""


@dataclass(frozen=True)
class LeftOutBlock:
    """Residuals of the r numbers of a block from a fit to all other numbers.

    ``errors``: (r,) (I - H)^-1 left with H = half half', the block's leverage, and ``left``, its residual from the fit of
    all; without the directions that the other numbers do not determine. ``kept``: (r,) share of each number that the others
    determine. ``log_density``: log probability density of the block given the others, without the constant.
    """

    errors: Floats
    kept: Floats
    log_density: float

    @staticmethod
    def of(half: Floats, left: Floats) -> LeftOutBlock:
        """The block of some rows.

        ``half``: (r, k) derivative of the block's numbers by what was fitted, times a root of its covariance. ``left``:
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
        return LeftOutBlock(errors, 1.0 - (lost**2).sum(axis=1), density)
