"""The linear problem of a diagnosis: whitened residuals, the geometry's derivative, and every hypothesis's displacements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import Measured, in_frame
from gtpin.effects.basis import Basis
from gtpin.effects.situation import Situation
from gtpin.instruments.readings import Readings
from gtpin.model.model import Model
from gtpin.noise.noise import Noise
from gtpin.noise.reading_noise import ReadingNoise

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
        (N c, p) whitened derivative by the geometry in tolerances, by the instruments' unknowns in prior sigmas, and by those
        without a prior: the pose of an instrument that is free.
    n_prior
        Number of columns of B with a prior, the first ones.
    taken
        Number of unknowns that no prior holds: they fit as many of the numbers exactly.
    measured
        What was measured.
    """

    situation: Situation
    whitening: Floats
    model: Model
    y: Floats
    B: Floats
    n_prior: int
    taken: int
    measured: Measured | Readings

    @staticmethod
    def of(
        situation: Situation,
        model: Model,
        measured: Measured | Readings,
        noise: Noise | ReadingNoise,
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
        J_q = measured.scatter(situation.command_jacobian, model, situation.poses)
        whitening = noise.whitening(J_q, measured.components) * np.sqrt(weight)[:, None, None]
        residual = measured.left(model, situation.poses)
        geometry = model.geometry
        by_geometry = model.kinematics.geometry_jacobian(measured.q, situation.poses) * geometry.tolerance
        unknowns, free = measured.unknown_columns(model, situation.poses, free_frame, pivot)
        by_all = np.concatenate([measured.seen(by_geometry, model, situation.poses), unknowns], axis=2)
        B = _whitened(whitening, by_all)
        deviation = np.concatenate([geometry.deviation / geometry.tolerance, measured.deviation])
        n_prior = B.shape[1] - free
        y = np.einsum("nij,nj->ni", whitening, residual).ravel() + B[:, :n_prior] @ deviation
        return Design(situation, whitening, model, y, B, n_prior, measured.taken(free_frame), measured)

    def columns(self, basis: Basis) -> Floats:
        """(N c, m) whitened displacements for coefficients of typical size."""
        return _whitened(self.whitening, self.seen(basis.displacement(self.situation) * basis.sigma))

    def seen(self, J: Floats) -> Floats:
        """(N, c, m) motions J (N, 6 + k, m) of the poses, base frame, and of k measured joints, as they are measured."""
        return self.measured.seen(J, self.model, self.situation.poses)

    @cached_property
    def command_jacobian(self) -> Floats:
        """(N, 6, n) derivative of the poses by the commands, instrument's frame."""
        return in_frame(self.situation.command_jacobian, self.model.frame)

    @cached_property
    def by_command(self) -> Floats:
        """(N, c, n) whitened motion by the commands."""
        return np.asarray(self.whitening @ self.by_command_seen)

    @cached_property
    def by_command_seen(self) -> Floats:
        """(N, c, n) derivative of what is measured by the commands."""
        return self.seen(self.situation.command_jacobian)

    @property
    def tracked(self) -> bool:
        """Whether rows are poses, measured by one tracker; otherwise they are readings of any instruments."""
        return isinstance(self.measured, Measured)

    @cached_property
    def units(self) -> Floats:
        """(N, c, c) what whitened numbers are of: m and rad of poses; the noise of readings, whose units differ."""
        if self.tracked:
            return np.asarray(np.linalg.inv(self.whitening))
        return np.broadcast_to(np.eye(self.components), self.whitening.shape)

    @cached_property
    def counted(self) -> npt.NDArray[np.bool_]:
        """(N, c) whether a number is a measurement of its own: rows may share one, such as a known distance."""
        return np.asarray(self.independent == 1.0)

    @cached_property
    def independent(self) -> Floats:
        """(N, c) how many measurements each number is: 1, or less where rows share one."""
        if isinstance(self.measured, Measured):
            return np.ones(self.whitening.shape[:2])
        return self.measured.counted

    @property
    def count(self) -> int:
        """Number of measured numbers, each that is shared counted once."""
        return round(float(self.independent.sum()))

    @property
    def dof(self) -> int:
        """Degrees of freedom of y' (I + B B')^-1 y: the measured numbers less those that unknowns without a prior fit."""
        return self.count - self.taken

    @property
    def compared(self) -> slice:
        """The numbers of a row whose errors make the gap: positions of poses; all of readings."""
        return slice(0, 3) if self.tracked else slice(0, self.components)

    @cached_property
    def prior(self) -> Floats:
        """(p,) weight of the square of each column's coefficient in B: none for what has no prior."""
        return np.concatenate([np.ones(self.n_prior), np.zeros(self.B.shape[1] - self.n_prior)])

    @property
    def components(self) -> int:
        """Numbers a pose."""
        return int(self.whitening.shape[1])


def _whitened(whitening: Floats, columns: Floats) -> Floats:
    return np.asarray(whitening @ columns).reshape(-1, columns.shape[2])
