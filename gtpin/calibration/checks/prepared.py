"""What a dataset must have for a robot; and the dataset without copies of rows and orientations that were not measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.data import Dataset, without_whole_turns
from gtpin.data.duplicates import counted_once
from gtpin.data.files import warn_of
from gtpin.data.plausible import check_extremes
from gtpin.errors import DatasetError
from gtpin.kinematics.rotations import log
from gtpin.model.measured_robot import robot_of
from gtpin.model.model import Model
from gtpin.noise.noise import Noise
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry


def prepared(dataset: Dataset, nominal: Model) -> Dataset:
    """The dataset with positions; without whole turns, copies of rows, and a constant orientation where the robot must turn.

    Raises `DatasetError` if dataset.toml contradicts the rows, or all commands are the same. Warns: says what is left out.
    """
    check_extremes(dataset)
    robot = nominal.robot
    dataset = without_whole_turns(dataset, robot)
    dataset = counted_once(with_positions(dataset, robot))
    wxyz = dataset.orientation
    if wxyz is None or len(wxyz) < 2 or (1.0 - np.abs(wxyz @ wxyz[0]) >= 1e-12).any():  # some 3 microradians
        return dataset
    poses = nominal.kinematics.forward(dataset.q)
    R = poses.R[poses.reached]
    if len(R) < 2 or float(np.linalg.norm(log(R @ R[0].T), axis=1).max()) <= 1e-5:  # less is rounding error
        return dataset
    text = "the orientation is the same in every row, though the robot turns: not measured; positions are used alone"
    warn_of(dataset.file, text)
    return replace(dataset, orientation=None)


def with_positions(dataset: Dataset, robot: Chain | None = None) -> Dataset:
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


def known_noise(dataset: Dataset, position: float | None, orientation: float | None, repeatability: float) -> Noise:
    """The noise of measured poses from sigmas per axis, m and rad, and the repeatability of the actuators, m or rad.

    Raises `DatasetError` if a sigma that the data need is not known (None).
    """
    if position is None or (orientation is None and dataset.orientation is not None):
        column = f"instrument.{'position' if position is None else 'orientation'}_sigma"
        hint = "declare position_sigma and orientation_sigma under [instrument], or calibrate the model again"
        what = "the noise is not known: neither these data nor the model state it"
        raise DatasetError(what, file=dataset.file, column=column, hint=hint)
    return Noise(position, 1.0 if orientation is None else orientation, repeatability)
