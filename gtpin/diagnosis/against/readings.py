"""The readings of a check by any instruments that can be used, and their noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.calibrate_readings import with_positions
from gtpin.calibration.checks.readable_sockets import check_sockets
from gtpin.data import Dataset, check_commands
from gtpin.data.duplicates import counted_once
from gtpin.data.sane import check_extremes, sane_rows
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.readings import VAGUE, Readings, single
from gtpin.kinematics.poses import Poses
from gtpin.model.measured_robot import measuring
from gtpin.model.model import Model
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats

STEPS = 20
"""Most Gauss-Newton steps of the instruments' unknowns. Measured: a station that was declared half a metre off takes four."""
SETTLED = 1e-3
"""Change of the unknowns, in standard deviations of their priors, that ends the steps; less than the check's other errors."""


def reading_model(model: Model, dataset: Dataset) -> Model:
    """The model with the passive joints measured that the dataset's encoders read; itself for the poses of a tracker.

    Raises `DatasetError` for a joint that can't be read.
    """
    if dataset.readings is None:
        return model
    geometry = model.geometry
    return replace(model, geometry=replace(geometry, robot=measuring(geometry.robot, dataset)))


def usable_readings(dataset: Dataset, model: Model) -> tuple[Dataset, Readings]:
    """The readings of a dataset that a check of a model can use, one row for each; impossible ones are left out.

    Raises `DatasetError` if the readings can't be those of this robot, or an instrument's noise is not declared.
    """
    robot = model.robot
    check_extremes(dataset)
    dataset = counted_once(with_positions(dataset, robot))
    check_sockets(dataset, robot)
    whole = single(dataset, robot)
    check_commands(dataset, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute)
    assert whole.readings is not None
    kept = whole.take(sane_rows(whole) & whole.readings.countable)
    reached = model.kinematics.forward(kept.q).reached
    if not reached.all():
        warn(f"set aside, for the robot can't reach them: {', '.join(map(str, dict.fromkeys(kept.pose[~reached])))}")
    kept = kept.take(reached).in_order()
    readings = Readings.of(kept, robot)
    _check_declared(readings, dataset)
    return kept, readings


def noise_of_readings(readings: Readings, scatter: float) -> ReadingNoise:
    """The declared noise of readings, with the scatter of every drive, m or rad."""
    declared = np.array([np.nan if sigma is None else sigma for sigma in readings.declared])
    estimated = np.zeros(len(declared), dtype=bool)
    return ReadingNoise(declared, readings.group, readings.row_sigma, estimated, scatter)


def with_unknowns(readings: Readings, noise: ReadingNoise, J: Floats, poses: Poses) -> Readings:
    """The readings with the values of the instruments' unknowns that fit them best where the robot is at ``poses``.

    The linear problem of a check is about these values, because the unknown place of an instrument may be off by decimetres.

    ``J``: (N, 6 + k, n) derivative of the poses, base frame, by the commands. ``poses``: (N) poses that the earlier model
    predicts, base frame.

    Raises `ConvergenceError` if they have not converged.
    """
    found = readings.at(readings.start(poses))
    if not len(found.sigma):
        return found
    sigma = np.where(np.isfinite(found.sigma), found.sigma, VAGUE)
    prior = np.isfinite(found.sigma).astype(float)
    for _ in range(STEPS):
        W = noise.whitening(np.asarray(found.by_motion(poses) @ J), found.components)
        columns = (W @ found.by_unknown(poses)).reshape(-1, len(sigma)) * sigma
        left = np.einsum("nij,nj->ni", W, found.minus(poses)).ravel()
        right = columns.T @ left - prior * found.deviation
        step = np.linalg.lstsq(columns.T @ columns + np.diag(prior), right, rcond=None)[0]
        found = found.at(found.u + sigma * step)
        if np.abs(step).max() < SETTLED:
            return found
    raise ConvergenceError(
        "the unknowns of the instruments have not converged",
        hint="check their stations, planes, sockets and targets in dataset.toml",
    )


def _check_declared(readings: Readings, dataset: Dataset) -> None:
    """Refuse readings whose noise is not declared: a check has too few to estimate it."""
    declared = np.array([sigma is not None for sigma in readings.declared])
    lacking = ~declared[readings.group] & ~np.isfinite(readings.row_sigma)
    if lacking.any():
        name = readings.rows.tables[int(readings.rows.of[lacking.any(axis=1)][0])].name
        raise DatasetError(
            f"the noise of {name} is not declared, and a check has too few readings to estimate it",
            file=dataset.file,
            hint=f"give the sigma of {name} in dataset.toml",
        )
