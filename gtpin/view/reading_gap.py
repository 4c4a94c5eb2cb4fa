"""Residuals of a model at the readings of any instruments, drawn as errors in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.calibration.instrument_unknowns import with_unknowns
from gtpin.data import Dataset, check_commands
from gtpin.errors import DatasetError, ModelError, warn
from gtpin.instruments.instrument import Instrument
from gtpin.instruments.readings import Readings, instruments_of, single
from gtpin.kinematics.poses import Poses
from gtpin.model.measured_robot import check_same_robot, measuring
from gtpin.model.model import FittedInstrument, Model
from gtpin.report.words import quantity
from gtpin.typing import Floats
from gtpin.view.gap import Gap, gap_of, whose


@dataclass(frozen=True)
class ReadingGap(Gap):
    """Measured less predicted readings of any instruments, of N rows.

    ``T`` is the predicted position of the target. ``error`` is the part of its position error that the reading measures: along
    the line of sight of a range, along the normal of a plane. It is zero for a tilt.

    Parameters
    ----------
    name
        (N,) the instrument of each row.
    value, unit
        (N,) size of the reading's residual, and its unit.
    whitened
        (N,) ``value`` over the declared standard deviation of the reading; if none is declared, over the root mean square of
        all values of the instrument.
    """

    name: tuple[str, ...] = ()
    value: Floats = ()  # type: ignore[assignment]
    unit: tuple[str, ...] = ()
    whitened: Floats = ()  # type: ignore[assignment]

    @property
    def names(self) -> list[str]:
        """Each pose's id, the instrument if there are several, and the row in the instrument's table."""
        if len(set(self.name)) == 1:
            return super().names
        return [f"{pose} ({name} row {row})" for pose, name, row in zip(self.pose, self.name, self.row, strict=True)]

    @property
    def size(self) -> Floats:
        """(N,) sizes of the errors, by which they are coloured and compared: ``whitened``."""
        return self.whitened

    @property
    def what(self) -> str:
        """Text: the kind of the errors, and the model that they are of."""
        return f"reading errors {self.whose}"

    @property
    def summary(self) -> str:
        """Text: root mean square of each instrument's errors, and number of readings."""
        names = np.array(self.name)
        sizes = []
        for one in dict.fromkeys(self.name):
            rows = np.flatnonzero(names == one)
            sizes.append(f"{one} {quantity(float(np.sqrt((self.value[rows] ** 2).mean())), self.unit[rows[0]])}")
        return f"{', '.join(sizes)} RMS at {len(self.q)} readings"

    def said(self, index: int) -> str:
        """Text with the instrument and the size of one error."""
        return f"{self.name[index]} off by {quantity(float(self.value[index]), self.unit[index])}"


def gap_with_instruments(model: Model, dataset: Dataset) -> tuple[Gap, tuple[FittedInstrument, ...]]:
    """The gap of a model at a dataset of any instruments, and the model's instruments.

    For a model without instruments, such as a nominal one, they are those of the dataset, and their unknowns have the values
    that fit the model best.

    Raises
    ------
    DatasetError
        If the commands do not fit the robot, or it can reach none of the poses.
    ModelError
        If the model is of another robot, a covariate is missing that an active effect needs, or the model lacks one of the
        instruments.

    Warns
    -----
    GtpinWarning
        If the robot can't reach some poses: names them; they are left out.
    """
    check_same_robot(model.robot, dataset)
    if dataset.readings is None:
        return gap_of(model, dataset), model.instruments
    robot = measuring(model.robot, dataset)
    model = replace(model, geometry=replace(model.geometry, robot=robot))
    check_commands(dataset, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute)
    poses = model.predict(dataset.q, dataset.covariates)
    if not poses.reached.any():
        raise DatasetError("the robot reaches none of these poses", file=dataset.file, hint="check robot and commands")
    if not poses.reached.all():
        names = ", ".join(dict.fromkeys(str(pose) for pose in dataset.pose[~poses.reached]))
        warn(f"left out, can't be reached: poses {names}")
    kept, poses = dataset.take(poses.reached), poses[poses.reached]
    fitted = model.instruments or _fitted(model, kept)
    return _gap(model, kept, poses, fitted), fitted


def _fitted(model: Model, dataset: Dataset) -> tuple[FittedInstrument, ...]:
    """The dataset's instruments with the values of their unknowns that fit a model best."""
    whole = single(dataset, model.robot)
    readings, poses = Readings.of(whole, model.robot), model.predict(whole.q, whole.covariates)
    return with_unknowns(readings.at(readings.start(poses)), poses).fitted


def _gap(model: Model, dataset: Dataset, poses: Poses, fitted: Sequence[FittedInstrument]) -> ReadingGap:
    rows = dataset.readings
    assert rows is not None
    known = {name: value for one in fitted for name, value in one.unknowns.items()}
    count = len(dataset)
    T, error, value, whitened = poses.T.copy(), np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    names, units = np.empty(count, dtype=object), np.empty(count, dtype=object)
    for i, one in enumerate(instruments_of(rows, model.robot)):
        mine = rows.rows_of(i)
        if not len(mine):
            continue
        u = _unknowns(one, known)
        there = poses[mine]
        left = one.minus(there, u)
        shown = np.array([c.shown for c in one.components])
        T[mine] = one.looked_at(there, u)
        error[mine] = np.einsum("mci,mc->mi", one.by_pose(there, u)[:, shown, :3], left[:, shown])
        value[mine] = np.linalg.norm(left[:, shown], axis=1)
        whitened[mine] = value[mine] / (one.declared[0] or max(float(np.sqrt((value[mine] ** 2).mean())), 1e-300))
        names[mine], units[mine] = one.name, next(c.unit for c in one.components if c.shown)
    words = tuple(map(str, names)), tuple(map(str, units))
    return ReadingGap(
        whose(model), dataset.pose, rows.line, dataset.q, T, error, {}, words[0], value, words[1], whitened
    )


def _unknowns(one: Instrument, known: dict[str, float]) -> Floats:
    """(k,) values of an instrument's unknowns; ``known``: those of the model, by name.

    Raises
    ------
    ModelError
        If one of the unknowns is not in ``known``.
    """
    missing = [unknown.name for unknown in one.unknowns if unknown.name not in known]
    if missing:
        hint = "give the model that gtpin calibrate makes of these data"
        raise ModelError(f"the model does not know {missing[0]}", hint=hint)
    return np.array([known[unknown.name] for unknown in one.unknowns])
