"""A dataset without copies of rows, and without orientations that were not measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.data import Dataset
from gtpin.data.duplicates import counted_once
from gtpin.data.sane import check_extremes
from gtpin.errors import warn
from gtpin.kinematics.rotations import log
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

SAME = 1e-12
"""1 less the cosine of half the angle, some 3 microradians, up to which orientations count as the same."""
TURNS = 1e-5
"""Angle, rad, by which the nominal orientation must change; less is rounding error of a robot that keeps its orientation."""


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


def with_positions(dataset: Dataset, robot: Robot) -> Dataset:
    """The dataset with the nominal TCP's positions, base frame, m, as ``position``: readings alone do not have any.

    These positions serve to divide the poses into regions. A row that the nominal robot can't reach gets the position of the
    first row that it can reach.
    """
    if dataset.readings is None or dataset.n_actuators != robot.n_actuators:
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
