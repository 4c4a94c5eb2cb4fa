"""The poses of a check that can be used, and their noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gtpin.calibration.checks.actuators import check_actuators
from gtpin.calibration.checks.known_noise import known_noise
from gtpin.calibration.checks.prepared import prepared
from gtpin.calibration.checks.usable_rows import plausible_rows
from gtpin.calibration.problem import Measured, measured_poses
from gtpin.data import Dataset
from gtpin.data.sane import sane_rows
from gtpin.diagnosis.priors import PRIORS
from gtpin.effects.drives import RIM
from gtpin.errors import DatasetError, ModelError, warn
from gtpin.health.expectation import Conditions
from gtpin.model.model import Model
from gtpin.noise.noise import Noise

FEWEST = 3
"""Fewest poses of a check: two measured positions have six numbers, as many as an instrument's pose has unknowns."""


@dataclass(frozen=True)
class Usable:
    """The usable poses of a check, and how they were measured."""

    dataset: Dataset
    measured: Measured
    how: Conditions

    def without(self, row: int) -> Usable:
        """The same without the row with the index ``row``."""
        kept = np.arange(len(self.dataset)) != row
        return Usable(self.dataset.take(kept), self.measured.take(kept), self.how)


def usable(dataset: Dataset, model: Model) -> Usable:
    """The rows of a dataset that a check of a model can use: rows with impossible values are left out.

    Raises
    ------
    DatasetError
        If the dataset does not match the model, or has too few poses.
    """
    if dataset.readings is not None:
        raise DatasetError(
            "a check against a model takes the poses of one tracker",
            file=dataset.file,
            hint='give a dataset of schema "gtpin-dataset/1", or diagnose these data by themselves',
        )
    check_actuators(model.robot, dataset)
    free = _free_frame(dataset, model)
    geometry = Model(model.geometry)
    recorded = prepared(dataset, geometry)
    kept = recorded.take(sane_rows(recorded))
    _check_count(kept)
    poses = geometry.kinematics.forward(kept.q)
    kept = kept.take(plausible_rows(kept, geometry, poses)).in_order()
    _check_count(kept)
    measured = measured_poses(replace(kept, orientation=None) if model.geometry.reduced else kept)
    how = Conditions(noise_of(dataset, model), free, dataset.conditions.reference_temperature)
    return Usable(kept, measured, how)


def noise_of(dataset: Dataset, model: Model) -> Noise:
    """The noise of a check: the instrument's declared sigmas, else those of the model's fit; and the actuators' in that fit.

    The actuators' noise is at least :func:`least_scatter`. All sigmas are multiplied by the fit's ratio of residuals to noise,
    ``misfit``.
    """
    declared, known = dataset.instrument, model.fit
    position, turns = declared.position_sigma, declared.orientation_sigma
    if known is None:
        noise = known_noise(dataset, position, turns, least_scatter(model))
        warn("the model states no noise of its fit: scatter of the drives is taken as the smallest; calibrate it again")
        return noise
    noise = Noise(
        known.position_sigma if position is None else position,
        known.orientation_sigma if turns is None else turns,
        max(known.drives, least_scatter(model)),
    )
    return noise.scaled(known.misfit)


def least_scatter(model: Model) -> float:
    """Smallest noise of each actuator, m or rad, that a check expects."""
    least = PRIORS.least_scatter
    return least / RIM if not model.robot.rods and bool(np.any(model.robot.revolute)) else least


def _free_frame(dataset: Dataset, model: Model) -> bool:
    free = dataset.instrument.frame == "free"
    if not free and not model.frame.is_base:
        raise ModelError(
            'the model was measured in a frame of the instrument, and the check in the base frame (frame = "robot")',
            file=dataset.file,
            column="instrument.frame",
            hint='set frame = "free" under [instrument]',
        )
    return free


def _check_count(dataset: Dataset) -> None:
    if len(dataset) < FEWEST:
        raise DatasetError(
            f"{len(dataset)} usable poses", file=dataset.file, hint=f"a check needs {FEWEST}, and better ten"
        )
