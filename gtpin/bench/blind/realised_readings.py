"""The realised explained fraction of the gap where readings were measured: predicted readings compared with the true ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gtpin.bench.blind.judged import Shrunk
from gtpin.bench.blind.truth import Truth
from gtpin.bench.blind.worker import Outcome
from gtpin.data import Dataset
from gtpin.data.instrument_tables import EncoderTable
from gtpin.model.measured_robot import robot_of
from gtpin.robot.measured_joints import measured_joint


def shrunk_readings(dataset: Dataset, truth: Truth, outcome: Outcome) -> Shrunk:
    """RMS errors of all instruments' readings in units of their noise, predicted by the baseline and by the model with the
    causes."""
    before, after = (
        rms_of_readings(dataset, truth, predicted) for predicted in (outcome.baseline_readings, outcome.model_readings)
    )
    return Shrunk(before=before, after=after)


def rms_of_readings(dataset: Dataset, truth: Truth, predicted: Mapping[str, list[list[float]]]) -> float:
    """RMS error of predicted readings (H, c), by instrument, in units of the noise; of joints that turn, modulo full turns."""
    turning = _turning(dataset)
    errors = []
    for true in truth.readings:
        error = np.array(predicted[true.name]) - np.array(true.values)
        if true.name in turning:
            error -= 2.0 * np.pi * np.round(error / (2.0 * np.pi))
        errors.append((error / np.array(true.sigma)).ravel())
    return float(np.sqrt((np.concatenate(errors) ** 2).mean()))


def _turning(dataset: Dataset) -> frozenset[str]:
    """Names of the encoders at joints that turn."""
    tables = () if dataset.readings is None else dataset.readings.tables
    encoders = [table for table in tables if isinstance(table, EncoderTable)]
    return frozenset(table.name for table in encoders if measured_joint(robot_of(dataset), table.joint).turns)
