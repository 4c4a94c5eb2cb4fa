"""What a dataset must have for a robot; and the dataset without copies of rows and orientations that were not measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.data import Dataset
from gtpin.data.duplicates import counted_once
from gtpin.data.sane import check_extremes
from gtpin.errors import DatasetError, warn
from gtpin.kinematics.rotations import log
from gtpin.model.measured_robot import robot_of
from gtpin.model.model import Model
from gtpin.noise.noise import Noise
from gtpin.robot.geometry import Geometry
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

SAME = 1e-12
"""1 less the cosine of half the angle, some 3 microradians, up to which orientations count as the same."""
TURNS = 1e-5
"""Angle, rad, by which the nominal orientation must change; less is rounding error of a robot that keeps its orientation."""


def check_actuators(robot: Robot, dataset: Dataset) -> None:
    """Check that a dataset has a command for each actuator of its robot.

    Raises `DatasetError` if the number of its commands is not the number of actuators.
    """
    if dataset.n_actuators != robot.n_actuators:
        raise DatasetError(
            f"{_counted(dataset.n_actuators, 'command')} a pose, but {robot.name} has "
            + _counted(robot.n_actuators, "actuator"),
            file=dataset.file,
            hint=f"give {'q1' if robot.n_actuators == 1 else f'q1 .. q{robot.n_actuators}'} ({', '.join(robot.sites)})"
            + (
                ", or name those that were commanded: actuators = [...]"
                if dataset.n_actuators < robot.n_actuators
                else ""
            ),
        )


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}{'s' if count != 1 else ''}"


def prepared(dataset: Dataset, nominal: Model) -> Dataset:
    """The dataset with positions, without copies of rows, and without a constant orientation where the robot must turn.

    Raises `DatasetError` if dataset.toml contradicts the rows, or all commands are the same. Warns: says what is left out.
    """
    check_extremes(dataset)
    dataset = counted_once(with_positions(dataset, nominal.robot))
    if dataset.orientation is None or not _same(dataset.orientation) or not _turns(dataset, nominal):
        return dataset
    text = "the orientation is the same in every row, though the robot turns: not measured; positions are used alone"
    warn(f"{dataset.file}: {text}" if dataset.file else text)
    return replace(dataset, orientation=None)


def with_positions(dataset: Dataset, robot: Robot | None = None) -> Dataset:
    """The dataset with the nominal TCP's positions, base frame, m, as ``position``: readings alone do not have any.

    ``robot``: the nominal robot; None: the one that the dataset names. These positions serve to divide the poses into regions.
    A row that the nominal robot can't reach gets the position of the first row that it can reach.
    """
    if dataset.readings.tracked:
        return dataset
    robot = robot_of(dataset) if robot is None else robot
    if dataset.n_actuators != robot.n_actuators:
        return dataset
    T = Model(Geometry.nominal(robot)).kinematics.forward(dataset.q).T.copy()
    reached = np.isfinite(T[:, 0])
    T[~reached] = T[reached][0] if reached.any() else 0.0
    return replace(dataset, position=T)


def _same(orientation: Floats) -> bool:
    return len(orientation) > 1 and bool((1.0 - np.abs(orientation @ orientation[0]) < SAME).all())


def _turns(dataset: Dataset, nominal: Model) -> bool:
    if dataset.n_actuators != nominal.robot.n_actuators:
        return False
    poses = nominal.kinematics.forward(dataset.q)
    R = poses.R[poses.reached]
    return len(R) > 1 and float(np.linalg.norm(log(R @ R[0].T), axis=1).max()) > TURNS


def known_noise(dataset: Dataset, position: float | None, orientation: float | None, repeatability: float) -> Noise:
    """The noise of measured poses from declared sigmas, or from those of a model.

    ``position``, ``orientation``: the instrument's standard deviations per axis, m and rad; None where neither the data nor
    a model states them. Orientation may be None where only positions were measured. ``repeatability``: repeatability of the
    actuators, m or rad.

    Raises `DatasetError` if a sigma that the data need is not known.
    """
    if position is None or (orientation is None and dataset.orientation is not None):
        raise DatasetError(
            "the noise is not known: neither these data nor the model state it",
            file=dataset.file,
            column="instrument.position_sigma" if position is None else "instrument.orientation_sigma",
            hint="declare position_sigma and orientation_sigma under [instrument], or calibrate the model again",
        )
    return Noise(position, 1.0 if orientation is None else orientation, repeatability)
