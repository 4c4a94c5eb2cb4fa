"""The rows of a check that can be used, and their noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.checks.prepared import check_actuators, known_noise, prepared, with_positions
from gtpin.calibration.checks.readable_readings import check_sockets
from gtpin.calibration.checks.usable_rows import plausible_rows
from gtpin.data import Dataset, check_commands
from gtpin.data.duplicates import counted_once
from gtpin.data.sane import check_extremes, sane_rows
from gtpin.diagnosis.against.expectation import Conditions
from gtpin.diagnosis.priors import PRIORS
from gtpin.effects.smooth import RIM
from gtpin.errors import DatasetError, ModelError, warn
from gtpin.instruments.readings import Readings, single
from gtpin.model.fit_conditions import EXPLAINED
from gtpin.model.model import Model
from gtpin.noise.noise import Noise
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise

FEWEST = 3
"""Fewest poses of a check: two measured positions have six numbers, as many as an instrument's pose has unknowns."""


@dataclass(frozen=True)
class Usable:
    """The usable rows of a check, and how they were measured."""

    dataset: Dataset
    measured: Readings
    how: Conditions

    def without(self, row: int) -> Usable:
        """The same without the row with the index ``row``; of a reading with several components, without all of them."""
        kept, where = np.any(self.places != self.places[row], axis=1), self.how
        return Usable(self.dataset.take(kept), self.measured.take(kept), replace(where, noise=where.noise.take(kept)))

    @property
    def places(self) -> npt.NDArray[np.int64]:
        """(N, 2) instrument and line in its table of each row."""
        return places(self.dataset)


def places(dataset: Dataset) -> npt.NDArray[np.int64]:
    """(N, 2) index of the instrument and line in its table of each row of a dataset."""
    return np.column_stack([dataset.readings.of, dataset.readings.line])


def usable(dataset: Dataset, model: Model) -> Usable:
    """The rows of a dataset that a check of a model can use: rows with impossible values are left out.

    Noise is the declared one, else that of the model's fit; that of the actuators, at least :func:`least_scatter`, is the
    fit's. All sigmas are multiplied by the fit's ratio of residuals to noise, ``misfit``. What the model left unexplained is
    not in it; noise that is known from nowhere but the residuals of the earlier fit is none.

    Raises `DatasetError` if the dataset does not match the model, or has too few poses, and `ModelError` if the model was
    measured in another frame.
    """
    check_actuators(model.robot, dataset)
    left, fit, drives = model.unexplained or EXPLAINED, model.fit, least_scatter(model)
    free, known = dataset.instrument.frame == "free", True
    if fit is not None:
        drives = max(fit.drives, drives)
    if not dataset.readings.tracked:
        kept, measured = _usable_readings(dataset, model)
        declared = np.array([np.nan if sigma is None else sigma for sigma in measured.declared])
        unknown = np.zeros(len(declared), dtype=bool)
        noise = ReadingNoise(declared, measured.group, measured.row_sigma, unknown, drives)
        if fit is not None:
            noise = noise.scaled(fit.misfit)
    else:
        kept, measured = _usable_poses(dataset, model, free)
        own = noise_of(dataset, model)
        lacking = [
            name for name in ("position_sigma", "orientation_sigma") if getattr(dataset.instrument, name) is None
        ]
        known = left.noise_known or not lacking
        if not known:
            none: dict[str, Any] = dict.fromkeys(lacking, SMALLEST)
            own = replace(own, **none)
        noise = own.rows(len(kept), measured.components)
    return Usable(kept, measured, Conditions(noise, free, dataset.conditions.reference_temperature, left, known))


def _usable_poses(dataset: Dataset, model: Model, free: bool) -> tuple[Dataset, Readings]:
    if not free and not model.frame.is_base:
        raise ModelError(
            'the model was measured in a frame of the instrument, and the check in the base frame (frame = "robot")',
            file=dataset.file,
            column="instrument.frame",
            hint='set frame = "free" under [instrument]',
        )
    geometry = Model(model.geometry)
    recorded = prepared(dataset, geometry)
    kept = recorded.take(sane_rows(recorded))
    _check_count(kept, len(kept))
    kept = kept.take(plausible_rows(kept, geometry, geometry.kinematics.forward(kept.q))).in_order()
    _check_count(kept, len(kept))
    return kept, Readings.of(replace(kept, orientation=None) if model.geometry.reduced else kept, model.robot)


def _usable_readings(dataset: Dataset, model: Model) -> tuple[Dataset, Readings]:
    """As :func:`usable`, one row for each reading. Their noise must be declared: a check has too few to estimate it."""
    robot = model.robot
    check_extremes(dataset)
    dataset = counted_once(with_positions(dataset, robot))
    check_sockets(dataset, robot)
    whole = single(dataset, robot)
    check_commands(dataset, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute)
    kept = whole.take(sane_rows(whole) & whole.readings.countable)
    reached = model.kinematics.forward(kept.q).reached
    if not reached.all():
        warn(f"set aside, for the robot can't reach them: {', '.join(map(str, dict.fromkeys(kept.pose[~reached])))}")
    kept = kept.take(reached).in_order()
    readings = Readings.of(kept, robot)
    declared = np.array([sigma is not None for sigma in readings.declared])
    lacking = ~declared[readings.group] & ~np.isfinite(readings.row_sigma)
    if lacking.any():
        name = readings.rows.tables[int(readings.rows.of[lacking.any(axis=1)][0])].name
        raise DatasetError(
            f"the noise of {name} is not declared, and a check has too few readings to estimate it",
            file=dataset.file,
            hint=f"give the sigma of {name} in dataset.toml",
        )
    _check_count(kept, len(np.unique(kept.visits)))
    return kept, readings


def _check_count(dataset: Dataset, poses: int) -> None:
    if poses < FEWEST:
        raise DatasetError(f"{poses} usable poses", file=dataset.file, hint=f"a check needs {FEWEST}, and better ten")


def noise_of(dataset: Dataset, model: Model) -> Noise:
    """The noise of measured poses for :func:`usable`, also where it is known from residuals alone."""
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
