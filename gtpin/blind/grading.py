"""Decides whether D of a case can be computed, and prepares its computation."""

from __future__ import annotations

import numpy as np

from gtpin.blind.difficulty import Difficulty
from gtpin.blind.truth import Truth
from gtpin.calibration.readings_result import ReadingsCalibration
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.typing import Floats


def gradable(dataset: Dataset, truth: Truth) -> bool:
    """Whether the truth has all that D needs: displacements, and the noise of what was measured.

    An encoder reads joints, whose displacements are in no truth.
    """
    if not truth.effects or any(effect.displacement is None for effect in truth.effects):
        return False
    if dataset.readings is None:
        return truth.sigma is not None or bool(truth.noise)
    tables = dataset.readings.tables
    return {one.name for one in truth.noise} == {t.name for t in tables} and not any(t.measured_joints for t in tables)


def difficulty_of(dataset: Dataset, truth: Truth, baseline: Calibration) -> Difficulty:
    """The :class:`Difficulty` of a gradable case, from its calibration."""
    noise = {one.name: np.array(one.sigma) for one in truth.noise}
    if isinstance(baseline, ReadingsCalibration):
        return Difficulty.of_readings(dataset, noise, baseline)
    sigma = np.array(truth.sigma) if truth.sigma is not None else _six(*noise.values())
    return Difficulty.of(dataset, sigma, baseline.model.geometry)


def _six(sigma: Floats) -> Floats:
    """(M, 6) noise of a tracker's rows, from (M, 3) or (M, 6); infinite where orientations are not measured."""
    return np.hstack([sigma, np.full((len(sigma), 6 - sigma.shape[1]), np.inf)])
