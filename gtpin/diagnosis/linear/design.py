"""The linear problem of a diagnosis: whitened residuals, the geometry's derivative, and every hypothesis's displacements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import Measured, in_frame
from gtpin.effects.basis import Basis
from gtpin.effects.situation import Situation
from gtpin.kinematics.rotations import frame_motions
from gtpin.model.model import Model
from gtpin.noise.noise import Noise

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Design:
    """Whitened residuals of N poses with c numbers each, and what they may be explained by, to first order.

    Parameters
    ----------
    situation
        The poses at the geometry about which everything is linear.
    whitening
        (N, c, c) of the measured poses.
    model
        That geometry, and the instrument's frame.
    y
        (N c,) whitened measured less predicted, with the part that the fitted deviation of the geometry has taken put back:
        what it would be at nominal geometry, to first order.
    B
        (N c, p) whitened derivative by the geometry in tolerances, and by the instrument's pose where that is free.
    """

    situation: Situation
    whitening: Floats
    model: Model
    y: Floats
    B: Floats

    @staticmethod
    def of(
        situation: Situation,
        model: Model,
        measured: Measured,
        noise: Noise,
        weight: Floats,
        free_frame: bool,
        pivot: Floats | None = None,
    ) -> Design:
        """Set up the linear problem about a fitted model.

        Parameters
        ----------
        measured, weight
            The poses, and (N,) what each counts in the fit.
        pivot
            (3,) what a free instrument turns about, in its frame, m: the middle of the poses by default.
        """
        J_q = in_frame(situation.command_jacobian, model.frame)
        whitening = noise.whitening(J_q, measured.components) * np.sqrt(weight)[:, None, None]
        residual = measured.minus(model.seen(situation.poses))
        geometry = model.geometry
        by_geometry = model.kinematics.geometry_jacobian(measured.q, situation.poses) * geometry.tolerance
        B = _whitened(whitening, in_frame(by_geometry, model.frame))
        deviation = geometry.deviation / geometry.tolerance
        y = np.einsum("nij,nj->ni", whitening, residual).ravel() + B @ deviation
        if free_frame:
            T = model.seen(situation.poses).T
            B = np.hstack([B, _frame_columns(whitening, T - (T.mean(axis=0) if pivot is None else pivot))])
        return Design(situation, whitening, model, y, B)

    def columns(self, basis: Basis) -> Floats:
        """(N c, m) whitened displacements for coefficients of typical size."""
        return _whitened(self.whitening, in_frame(basis.displacement(self.situation) * basis.sigma, self.model.frame))

    @cached_property
    def command_jacobian(self) -> Floats:
        """(N, 6, n) derivative of the poses by the commands, instrument's frame."""
        return in_frame(self.situation.command_jacobian, self.model.frame)

    @cached_property
    def by_command(self) -> Floats:
        """(N, c, n) whitened motion by the commands."""
        return np.asarray(self.whitening @ self.command_jacobian[:, : self.components])

    @property
    def n_geometry(self) -> int:
        """Number of geometric parameters; what follows them in B has no prior."""
        return len(self.model.geometry.parameters)

    @property
    def components(self) -> int:
        """Numbers a pose."""
        return int(self.whitening.shape[1])


def _whitened(whitening: Floats, columns: Floats) -> Floats:
    return np.asarray(whitening @ columns[:, : whitening.shape[1]]).reshape(-1, columns.shape[2])


def _frame_columns(whitening: Floats, T: Floats) -> Floats:
    """Shifts and turns of a free instrument about the origin of positions (N, 3), so large that the prior says nothing."""
    return _whitened(whitening, frame_motions(T))
