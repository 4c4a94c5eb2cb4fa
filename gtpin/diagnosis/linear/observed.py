"""The poses that a diagnosis works on, with their noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.noise_estimator import noise_at
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.linear.design import Design
from gtpin.effects.situation import Column, References, Situation
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

    def situation(self, model: Model, fixed: References | None = None, poses: Poses | None = None) -> Situation:
        """The poses at a model's geometry; ``poses``, base frame, where they are already computed."""
        kinematics = model.kinematics
        poses = kinematics.forward(self.measured.q) if poses is None else poses
        q = self.measured.q
        return Situation(kinematics, q, poses, self.covariates, fixed, self.temperature, self.unusable)

    def design(
        self,
        model: Model,
        fixed: References | None = None,
        poses: Poses | None = None,
        pivot: Floats | None = None,
    ) -> Design:
        """The linear problem about a model's geometry; ``pivot`` as for :meth:`Design.of`."""
        at = self.situation(model, fixed, poses)
        return Design.of(at, model, self.measured, self.noise, self.weight, self.free_frame, pivot)


def _without_repeatability(noise: ReadingNoise, measured: Readings, model: Model) -> ReadingNoise:
    """A calibration's noise without repeatability: a cause can make repeated visits differ.

    The whole scatter is then assigned to the sigmas that were not declared: where a cause makes visits differ, the instrument's
    part of the scatter is estimated too small.
    """
    sigma, estimated = noise.sigma, np.array([one is None for one in measured.declared])
    if noise.along_drives > 0.0:
        poses = model.kinematics.forward(measured.q)
        J = in_frame(model.kinematics.command_jacobian(measured.q, poses), model.frame)
        own = noise.along_drives**2 * (J**2).sum(axis=2).mean(axis=0)
        more = np.array([own[:3].mean(), own[3:].mean()])[: len(sigma)]
        sigma = np.where(estimated, np.sqrt(sigma**2 + more), sigma)
    return replace(noise, sigma=sigma, estimated=estimated, repeatability=0.0, lack=0.0)
