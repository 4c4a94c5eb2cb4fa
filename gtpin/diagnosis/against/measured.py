"""The poses of a check that can be used, and their noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.checks.actuators import check_actuators
from gtpin.calibration.checks.known_noise import known_noise
from gtpin.calibration.checks.prepared import prepared
from gtpin.calibration.checks.usable_rows import plausible_rows
from gtpin.data import Dataset
from gtpin.data.sane import sane_rows
from gtpin.diagnosis.against.expectation import Conditions
from gtpin.diagnosis.against.readings import noise_of_readings, usable_readings
from gtpin.diagnosis.priors import PRIORS
from gtpin.effects.drives import RIM
from gtpin.errors import DatasetError, ModelError, warn
from gtpin.instruments.readings import Readings
from gtpin.model.fit_conditions import EXPLAINED
from gtpin.model.model import Model
from gtpin.noise.noise import SMALLEST, Noise
from gtpin.noise.reading_noise import ReadingNoise

FEWEST = 3
"""Fewest poses of a check: two measured positions have six numbers, as many as an instrument's pose has unknowns."""


@dataclass(frozen=True)
class Usable:
    """The usable poses of a check, and how they were measured."""

    dataset: Dataset
    measured: Readings
    how: Conditions

    def without(self, row: int) -> Usable:
        """The same without the row with the index ``row``; of a reading with several components, without all of them."""
        kept = np.any(self.places != self.places[row], axis=1)
        noise = self.how.noise
        if isinstance(noise, ReadingNoise):
            noise = noise.take(kept)
        return Usable(self.dataset.take(kept), self.measured.take(kept), replace(self.how, noise=noise))

    @property
    def places(self) -> npt.NDArray[np.int64]:
        """(N, 2) instrument and line in its table of each row."""
        return places(self.dataset)


def places(dataset: Dataset) -> npt.NDArray[np.int64]:
    """(N, 2) index of the instrument and line in its table of each row of a dataset."""
    rows = dataset.readings
    of = np.zeros(len(dataset), dtype=np.int64) if rows is None else rows.of
    return np.column_stack([of, dataset.row if rows is None else rows.line])


def usable(dataset: Dataset, model: Model) -> Usable:
    """The rows of a dataset that a check of a model can use: rows with impossible values are left out.

    Raises `DatasetError` if the dataset does not match the model, or has too few poses.
    """
    check_actuators(model.robot, dataset)
    if dataset.readings is not None:
        return _readings(dataset, model)
    free = _free_frame(dataset, model)
    geometry = Model(model.geometry)
    recorded = prepared(dataset, geometry)
    kept = recorded.take(sane_rows(recorded))
    _check_count(kept)
    poses = geometry.kinematics.forward(kept.q)
    kept = kept.take(plausible_rows(kept, geometry, poses)).in_order()
    _check_count(kept)
    measured = Readings.of(replace(kept, orientation=None) if model.geometry.reduced else kept, model.robot)
    return Usable(kept, measured, _conditions(dataset, model, noise_of(dataset, model), free))


def _readings(dataset: Dataset, model: Model) -> Usable:
    kept, readings = usable_readings(dataset, model)
    if len(np.unique(kept.visits)) < FEWEST:
        _check_count(kept.take(np.unique(kept.visits, return_index=True)[1]))
    known = model.fit
    scatter = least_scatter(model) if known is None else max(known.drives, least_scatter(model))
    noise = noise_of_readings(readings, scatter).scaled(1.0 if known is None else known.misfit)
    return Usable(kept, readings, _conditions(dataset, model, noise, False))


def _conditions(dataset: Dataset, model: Model, noise: Noise | ReadingNoise, free: bool) -> Conditions:
    """How a check was measured. Noise that is known from nowhere but the residuals of the earlier fit is none."""
    left, declared = model.unexplained or EXPLAINED, dataset.instrument
    lacking = declared.position_sigma is None, declared.orientation_sigma is None
    unknown = isinstance(noise, Noise) and not left.noise_known and any(lacking)
    if isinstance(noise, Noise) and unknown:
        noise = replace(
            noise,
            position_sigma=SMALLEST if lacking[0] else noise.position_sigma,
            orientation_sigma=SMALLEST if lacking[1] else noise.orientation_sigma,
        )
    return Conditions(noise, free, dataset.conditions.reference_temperature, left, not unknown)


def noise_of(dataset: Dataset, model: Model) -> Noise:
    """The noise of a check: the instrument's declared sigmas, else those of the model's fit; and the actuators' in that fit.

    The actuators' noise is at least :func:`least_scatter`. All sigmas are multiplied by the fit's ratio of residuals to noise,
    ``misfit``. What the model left unexplained is not in it.
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
