"""The conditions of the fit of a model: what a later check of the same machine is compared with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gtpin.data.table import Column
from gtpin.noise.noise import Noise

TEMPERATURES = ("temp_frame", "temp_link")
"""Covariates of which a model keeps the mean over its fit."""


@dataclass(frozen=True)
class FitConditions:
    """Noise and temperatures of the poses that a model was fitted to; sigmas are one standard deviation.

    Parameters
    ----------
    position_sigma, orientation_sigma
        The instrument's, per axis, m and rad, declared or estimated.
    drives
        Of every actuator, m or rad: repeatability, and what the model lacks along the motions of single drives.
    misfit
        Ratio of the residuals to this noise, where they are larger, else 1.
    temp_frame, temp_link
        Mean temperatures, degC; None where they were not recorded.
    """

    position_sigma: float
    orientation_sigma: float
    drives: float
    misfit: float = 1.0
    temp_frame: float | None = None
    temp_link: float | None = None

    @staticmethod
    def of(noise: Noise, misfit: float, covariates: Mapping[str, Column]) -> FitConditions:
        """Those of a fit with a noise, a ratio of the residuals to it, and covariates (N,) by name."""
        mean = {n: float(np.mean(np.asarray(covariates[n], dtype=float))) for n in TEMPERATURES if n in covariates}
        return FitConditions(
            position_sigma=float(noise.position_sigma),
            orientation_sigma=float(noise.orientation_sigma),
            drives=noise.along_drives,
            misfit=max(float(misfit), 1.0),
            **mean,
        )
