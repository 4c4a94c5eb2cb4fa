"""The linear problem of a diagnosis: whitened residuals, derivative by the geometry, displacements of the hypotheses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.effects.basis import Basis
from gtpin.effects.situation import Situation
from gtpin.instruments.readings import Readings
from gtpin.model.model import Model, in_frame
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats


@dataclass(frozen=True)
class Design:
    """Whitened residuals of N rows with c numbers each, and their derivative by the unknowns.

    - ``situation``: the poses at the geometry about which the problem is linearised.
    - ``whitening``: (N, c, c) whitening matrices of the rows.
    - ``model``: that geometry, and the instrument's frame.
    - ``y``: (N c,) whitened measured less predicted, with the effect of the fitted deviation of the geometry added: to
      first order, the residual at nominal geometry.
    - ``B``: (N c, p) whitened derivative by the geometry in units of the tolerances, by the instruments' unknowns in units
      of their prior sigmas, and by unknowns without a prior, such as the pose of a free instrument.
    - ``n_prior``: number of columns of B with a prior, the first ones.
    - ``taken``: number of unknowns without a prior: they take as many degrees of freedom.
    - ``measured``: the measured poses or readings.
    """

    situation: Situation
    whitening: Floats
    model: Model
    y: Floats
    B: Floats
    n_prior: int
    taken: int
    measured: Readings

    @staticmethod
    def of(
        situation: Situation,
        model: Model,
        measured: Readings,
        noise: ReadingNoise,
        weight: Floats,
        free_frame: bool,
        pivot: Floats | None = None,
    ) -> Design:
        """Set up the linear problem about a fitted model.

        ``measured``, ``weight``: the measured poses or readings, and (N,) their weights in the fit. ``pivot``: (3,) centre
        of rotation of a free instrument's pose, instrument's frame, m; by default the middle of the poses.
        """
        J_q = measured.seen(situation.command_jacobian, model, situation.poses)
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
        """(N, c, m) changes of the measured numbers by motions J (N, 6 + k, m) of the poses, base frame, and of k measured
        joints."""
        return self.measured.seen(J, self.model, self.situation.poses)

    @cached_property
    def command_jacobian(self) -> Floats:
        """(N, 6, n) derivative of the poses by the commands, instrument's frame."""
        return in_frame(self.situation.command_jacobian, self.model.frame)

    @cached_property
    def by_command(self) -> Floats:
        """(N, c, n) whitened derivative by the commands."""
        return np.asarray(self.whitening @ self.by_command_seen)

    @cached_property
    def by_command_seen(self) -> Floats:
        """(N, c, n) derivative of the measured numbers by the commands."""
        return self.seen(self.situation.command_jacobian)

    @cached_property
    def units(self) -> Floats:
        """(N, c, c) factors from whitened numbers to m and rad, for poses; identities for readings, whose units differ."""
        if self.measured.tracked:
            return np.asarray(np.linalg.inv(self.whitening))
        return np.broadcast_to(np.eye(self.components), self.whitening.shape)

    @cached_property
    def counted(self) -> npt.NDArray[np.bool_]:
        """(N, c) whether a number is a separate measurement: several rows can share one, such as a known distance."""
        return np.asarray(self.independent == 1.0)

    @cached_property
    def independent(self) -> Floats:
        """(N, c) number of measurements that each number counts as: 1, or less where several rows share it."""
        return self.measured.counted

    @property
    def count(self) -> int:
        """Number of measured numbers; a number that several rows share counts once."""
        return round(float(self.independent.sum()))

    @property
    def dof(self) -> int:
        """Degrees of freedom of y' (I + B B')^-1 y: the measured numbers less those that unknowns without a prior fit."""
        return self.count - self.taken

    @property
    def compared(self) -> slice:
        """The numbers of a row from which the gap is computed: the position of a pose; all numbers of readings."""
        return slice(0, 3) if self.measured.tracked else slice(0, self.components)

    @cached_property
    def prior(self) -> Floats:
        """(p,) precision of the prior of each coefficient of B: 1, or 0 without a prior."""
        return np.concatenate([np.ones(self.n_prior), np.zeros(self.B.shape[1] - self.n_prior)])

    @property
    def components(self) -> int:
        """c, the numbers per row."""
        return int(self.whitening.shape[1])


def _whitened(whitening: Floats, columns: Floats) -> Floats:
    return np.asarray(whitening @ columns).reshape(-1, columns.shape[2])
