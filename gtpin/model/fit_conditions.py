"""The conditions of the fit of a model, and what it left unexplained: a later check of the machine is compared with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gtpin.data.table import Column
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats

TEMPERATURES = ("temp_frame", "temp_link")
"""Covariates of which a model keeps the mean over its fit."""


@dataclass(frozen=True)
class ModelDiscrepancy:
    """Errors of a fitted model that differ from pose to pose and are not noise, per axis, as standard deviations.

    They are a part of the uncertainty of every prediction of the model.

    ``position``, ``orientation``: of the position, m, and of the orientation, rad; 0 where chi-square shows no such errors, but
    for what may hide of the position's behind a noise that repeated visits show roughly.
    ``noise_known``: True: the noise was declared, or repeated visits of poses showed it. False: what was left of the fit
    can't be divided into noise and errors of the model, and all of it counts as unexplained.
    ``least``, ``most``: ends of the 95 % interval of ``position``, m; ``least`` is 0 where all of it can be noise. None: not
    known, as in models of older versions.
    """

    position: float
    orientation: float
    noise_known: bool = True
    least: float | None = None
    most: float | None = None

    @property
    def none(self) -> bool:
        """Whether noise can be all that is unexplained."""
        return self.orientation == 0.0 and (self.interval[0] if self.noise_known else self.position) == 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """``least`` and ``most``; where they are not known, ``position``, or 0 if all of it can be noise."""
        least = self.position if self.noise_known else 0.0
        return least if self.least is None else self.least, self.position if self.most is None else self.most

    def of_position(self, size: float) -> ModelDiscrepancy:
        """The same, with another size of the position's, m per axis."""
        least, most = self.interval
        return replace(self, position=size, least=min(least, size), most=max(most, size))

    def beside(self, scatter: float, most: float) -> ModelDiscrepancy:
        """The same with scatter between visits, m per axis, as errors of the machine: what the declared sigma does not contain,
        and at ``most``. ``least`` is without: the declared sigma can be wrong."""
        least, end = self.interval
        position, end = float(np.hypot(self.position, scatter)), float(np.hypot(end, most))
        return replace(self, position=position, least=least, most=end)


EXPLAINED = ModelDiscrepancy(0.0, 0.0)
"""Nothing is unexplained."""


@dataclass(frozen=True)
class FitConditions:
    """Noise and temperatures of the poses that a model was fitted to; sigmas are one standard deviation.

    - ``position_sigma``, ``orientation_sigma``: noise of the instrument, per axis, m and rad, declared or estimated.
    - ``drives``: noise of every actuator, m or rad: repeatability, and errors along its motion that the model does not
      explain.
    - ``misfit``: ratio of the residuals to this noise, sqrt(chi-square per degree of freedom), plus one standard deviation
      and at least 1. A check multiplies its noise by it. It is 1 where the model states what it left unexplained.
    - ``temp_frame``, ``temp_link``: mean temperatures, degC; None where they were not recorded.
    - ``lower``, ``upper``: (n,) smallest and largest commands, m or rad; empty in models of older versions.
    """

    position_sigma: float
    orientation_sigma: float
    drives: float
    misfit: float = 1.0
    temp_frame: float | None = None
    temp_link: float | None = None
    lower: tuple[float, ...] = ()
    upper: tuple[float, ...] = ()

    @staticmethod
    def of(
        noise: ReadingNoise,
        chi2: float,
        dof: float,
        q: Floats,
        covariates: Mapping[str, Column],
        unexplained: ModelDiscrepancy,
    ) -> FitConditions:
        """The conditions of a fit, from its noise, its chi-square with ``dof`` degrees of freedom, commands (N, n), covariates
        (N,) by name, and what it left unexplained."""
        power = chi2 / dof * (1.0 + np.sqrt(2.0 / dof)) if unexplained.none else 1.0
        mean = {n: float(np.mean(np.asarray(covariates[n], dtype=float))) for n in TEMPERATURES if n in covariates}
        return FitConditions(
            position_sigma=noise.position_sigma,
            orientation_sigma=noise.orientation_sigma,
            drives=noise.repeatability,
            misfit=float(np.sqrt(max(power, 1.0))),
            lower=tuple(q.min(axis=0).tolist()),
            upper=tuple(q.max(axis=0).tolist()),
            **mean,
        )
