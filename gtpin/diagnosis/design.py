"""The linear problem of a diagnosis: whitened residuals, derivative by the geometry, displacements of the hypotheses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.calibration.noise_estimator import noise_at
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import Column, OperatingPoints, References
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model, in_frame
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.noise.weights import Tails
from gtpin.typing import Floats


@dataclass(frozen=True)
class Observed:
    """The poses that a diagnosis works on.

    - ``measured``: commands and poses, instrument's frame.
    - ``covariates``: (N,) values of each covariate, by name.
    - ``noise``, ``weight``: the noise of the poses, and (N,) their weights.
    - ``temperature``: temperature at which the geometry holds, degC.
    - ``free_frame``: whether the instrument's pose is identified too.
    - ``unusable``: names of covariates that were recorded but cannot be right.
    - ``tails``: tails of the noise by number of the rows' kind (``kinds``), where a fit computes the weights from its
      residuals; where it is empty, ``weight`` has them.
    """

    measured: Readings
    covariates: Mapping[str, Column]
    noise: ReadingNoise
    weight: Floats
    temperature: float
    free_frame: bool
    unusable: frozenset[str] = frozenset()
    tails: Mapping[int, Tails] = field(default_factory=dict)

    @staticmethod
    def of(dataset: Dataset, baseline: Calibration) -> Observed:
        """The rows of a dataset with the noise and the unknowns that a calibration found.

        For poses, repeatability is left out: a cause can make repeated visits differ.
        """
        measured = Readings.of(dataset, baseline.model.robot, baseline.u)
        noise = noise_at(baseline.noise, measured)
        # A sigma that visits contradict counts as declared: a cause can make repeated visits differ.
        sigmas = zip(measured.declared, noise.sigma, strict=True)
        noise = replace(
            noise,
            sigma=np.array([s if own is None else min(own, s) for own, s in sigmas]),
            estimated=np.array([own is None for own in measured.declared]),
        )
        if not noise.estimated.any():
            noise = replace(noise, source="declared", dof=np.inf)
        if measured.tracked:
            noise = _without_repeatability(noise, measured, baseline.model)
        return Observed(
            measured=measured,
            covariates=dataset.covariates,
            noise=noise,
            weight=np.ones(len(dataset)),
            temperature=dataset.conditions.reference_temperature,
            free_frame=dataset.instrument.frame == "free",
            unusable=dataset.unusable,
        )

    def take(self, rows: npt.NDArray[np.generic] | slice) -> Observed:
        """Some of the poses."""
        return replace(
            self,
            measured=self.measured.take(rows),
            covariates={name: values[rows] for name, values in self.covariates.items()},
            noise=self.noise.take(rows),
            weight=self.weight[rows],
        )

    @property
    def kinds(self) -> npt.NDArray[np.intp]:
        """(N,) number of the group of rows in which each row's residuals are compared with others: see ``Readings.alike``."""
        return self.measured.group[:, 0]

    def weigh(self, residual: Floats) -> Floats:
        """(N,) weights of the rows in a fit with whitened residuals (N, c)."""
        weight, kinds = self.weight.copy(), self.kinds
        for kind, tails in self.tails.items():
            weight[kinds == kind] = tails.weigh(residual[kinds == kind])
        return weight

    def operating_points(
        self, model: Model, fixed: References | None = None, poses: Poses | None = None
    ) -> OperatingPoints:
        """The poses at a model's geometry; ``poses``, base frame, where they are already computed."""
        kinematics = model.kinematics
        poses = kinematics.forward(self.measured.q) if poses is None else poses
        q = self.measured.q
        return OperatingPoints(kinematics, q, poses, self.covariates, fixed, self.temperature, self.unusable)

    def design(self, model: Model, fixed: References | None = None) -> Design:
        """The linear problem about a model's geometry."""
        at = self.operating_points(model, fixed)
        return Design.of(at, model, self.measured, self.noise, self.weight, self.free_frame)


def _without_repeatability(noise: ReadingNoise, measured: Readings, model: Model) -> ReadingNoise:
    """A calibration's noise without repeatability: a cause can make repeated visits differ.

    The whole scatter is then assigned to the sigmas that were not declared: where a cause makes visits differ, the instrument's
    part of the scatter is estimated too small.
    """
    sigma = noise.sigma
    if noise.repeatability > 0.0:
        poses = model.kinematics.forward(measured.q)
        J = in_frame(model.kinematics.command_jacobian(measured.q, poses), model.frame)
        own = noise.repeatability**2 * (J**2).sum(axis=2).mean(axis=0)
        more = np.array([own[:3].mean(), own[3:].mean()])[: len(sigma)]
        sigma = np.where(noise.estimated, np.sqrt(sigma**2 + more), sigma)
    return replace(noise, sigma=sigma, repeatability=0.0)


@dataclass(frozen=True)
class Design:
    """Whitened residuals of N rows with c numbers each, and their derivative by the unknowns.

    - ``operating_points``: the poses at the geometry about which the problem is linearised.
    - ``whitening``: (N, c, c) whitening matrices of the rows.
    - ``model``: that geometry, and the instrument's frame.
    - ``y``: (N c,) whitened measured less predicted, with the effect of the fitted deviation of the geometry added: to
      first order, the residual at nominal geometry.
    - ``B``: (N c, p) whitened derivative by the geometry in units of the tolerances, by the instruments' unknowns in units
      of their prior sigmas, and by unknowns without a prior, such as the pose of a free instrument.
    - ``n_prior``: number of columns of B with a prior, the first ones.
    - ``free_unknowns``: number of unknowns without a prior: they take as many degrees of freedom.
    - ``measured``: the measured poses or readings.
    """

    operating_points: OperatingPoints
    whitening: Floats
    model: Model
    y: Floats
    B: Floats
    n_prior: int
    free_unknowns: int
    measured: Readings

    @staticmethod
    def of(
        operating_points: OperatingPoints,
        model: Model,
        measured: Readings,
        noise: ReadingNoise,
        weight: Floats,
        free_frame: bool,
    ) -> Design:
        """Set up the linear problem about a fitted model.

        ``measured``, ``weight``: the measured poses or readings, and (N,) their weights in the fit.
        """
        J_q = measured.change_by(operating_points.command_jacobian, model, operating_points.poses)
        whitening = noise.whitening(J_q, measured.components) * np.sqrt(weight)[:, None, None]
        residual = measured.residual(model, operating_points.poses)
        geometry = model.geometry
        by_geometry = model.kinematics.geometry_jacobian(measured.q, operating_points.poses) * geometry.tolerance
        unknowns, free = measured.unknown_columns(model, operating_points.poses, free_frame, None)
        by_all = np.concatenate([measured.change_by(by_geometry, model, operating_points.poses), unknowns], axis=2)
        B = _whitened(whitening, by_all)
        deviation = np.concatenate([geometry.deviation / geometry.tolerance, measured.deviation])
        n_prior = B.shape[1] - free
        y = np.einsum("nij,nj->ni", whitening, residual).ravel() + B[:, :n_prior] @ deviation
        return Design(operating_points, whitening, model, y, B, n_prior, measured.free_unknowns(free_frame), measured)

    def beside(self, columns: Floats) -> tuple[Floats, Floats]:
        """(N c, p + m) B and further columns (N c, m), and (p + m,) precisions of the priors of all coefficients."""
        return np.hstack([self.B, columns]), np.concatenate([self.prior, np.ones(columns.shape[1])])

    def coloured(self, whitened: Floats) -> Floats:
        """(N, c) whitened numbers in their own units, m and rad."""
        return np.asarray(np.einsum("nij,nj->ni", np.linalg.inv(self.whitening), whitened))

    def columns(self, basis: Displacement) -> Floats:
        """(N c, m) whitened displacements for coefficients of typical size."""
        return _whitened(self.whitening, self.change_by(basis.displacement(self.operating_points) * basis.sigma))

    def change_by(self, J: Floats) -> Floats:
        """(N, c, m) changes of the measured numbers by motions J (N, 6 + k, m) of the poses, base frame, and of k measured
        joints."""
        return self.measured.change_by(J, self.model, self.operating_points.poses)

    @cached_property
    def by_command(self) -> Floats:
        """(N, c, n) whitened derivative by the commands."""
        return np.asarray(self.whitening @ self.by_command_seen)

    @cached_property
    def by_command_seen(self) -> Floats:
        """(N, c, n) derivative of the measured numbers by the commands."""
        return self.change_by(self.operating_points.command_jacobian)

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
        return self.count - self.free_unknowns

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
