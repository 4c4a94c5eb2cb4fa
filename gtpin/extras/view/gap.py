"""The gap of a model at the rows of a dataset, for drawings: errors in the base frame, and each rod's share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import with_unknowns
from gtpin.data import Dataset
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import DatasetError, ModelError, warn
from gtpin.instruments.readings import Readings, instruments_of, single
from gtpin.model.measured_robot import check_same_robot, measuring
from gtpin.model.model import FittedInstrument, Model
from gtpin.report.figure import round_below
from gtpin.report.words import quantity
from gtpin.robot.command_ranges import check_commands, without_whole_turns
from gtpin.typing import Floats

CALIBRATED = "give the model that gtpin calibrate makes of these data"


@dataclass(frozen=True)
class DrawnGap:
    """Measured less predicted at N rows of a dataset: poses, or readings of any instruments.

    - ``whose``: text after "errors" that says of which model they are, such as "of the nominal model".
    - ``pose``, ``row``: (N,) the poses' ids, and their lines in the instrument's table.
    - ``q``: (N, n) commands, m or rad.
    - ``T``: (N, 3) predicted position of the TCP, or of the instrument's target, base frame, m.
    - ``error``: (N, 3) the part of the position error that is measured, base frame, m: for a range along the line of sight,
      for a plane along its normal, zero for a tilt.
    - ``share``: by site, each rod's share, 0 to 1, of the mean squared error that exceeds the declared noise, with errors
      mapped to lengths of the rods; empty for a robot without rods, and for readings.
    - ``name``: (N,) the instrument of each row; "" where poses were measured.
    - ``value``, ``unit``: (N,) size of the reading's residual, and its unit.
    - ``whitened``: (N,) ``value`` over the declared standard deviation of the reading; if none is declared, over the root
      mean square of all values of the instrument.
    """

    whose: str
    pose: npt.NDArray[np.object_]
    row: npt.NDArray[np.int64]
    q: Floats
    T: Floats
    error: Floats
    share: dict[str, float]
    name: tuple[str, ...]
    value: Floats
    unit: tuple[str, ...]
    whitened: Floats

    @property
    def of_poses(self) -> bool:
        """Whether poses were measured, by one tracker."""
        return not self.name[0]

    @property
    def length(self) -> Floats:
        """(N,) lengths of the errors, m."""
        return np.asarray(np.linalg.norm(self.error, axis=1))

    @property
    def rms(self) -> float:
        """Root mean square of the errors' lengths, m."""
        return float(np.sqrt((self.length**2).mean()))

    @property
    def names(self) -> list[str]:
        """Each pose's id, the instrument if there are several, and the row in its table: no two are the same."""
        several = len(set(self.name)) > 1
        rows = zip(self.pose, self.name, self.row, strict=True)
        return [f"{pose} ({f'{name} ' if several else ''}row {row})" for pose, name, row in rows]

    @property
    def size(self) -> Floats:
        """(N,) sizes by which errors are coloured and compared: lengths, m; ``whitened`` for readings."""
        return self.length if self.of_poses else self.whitened

    @property
    def what(self) -> str:
        """Text: the kind of the errors, and the model that they are of."""
        return f"{'position' if self.of_poses else 'reading'} errors {self.whose}"

    @property
    def summary(self) -> str:
        """Text: root mean square of each instrument's errors, and number of poses or readings."""
        if self.of_poses:
            return f"{1e6 * self.rms:,.0f} µm RMS at {len(self.q)} poses"
        names, sizes = np.array(self.name), []
        for one in dict.fromkeys(self.name):
            rows = np.flatnonzero(names == one)
            sizes.append(f"{one} {quantity(float(np.sqrt((self.value[rows] ** 2).mean())), self.unit[rows[0]])}")
        return f"{', '.join(sizes)} RMS at {len(self.q)} readings"

    def said(self, index: int) -> str:
        """Text with the instrument, where it has a name, and the size of one error."""
        if self.of_poses:
            return f"off by {1e6 * self.length[index]:,.1f} µm"
        return f"{self.name[index]} off by {quantity(float(self.value[index]), self.unit[index])}"

    def magnification(self) -> float:
        """A round factor for drawings: with it, the median error is at most a tenth of the workspace. 1 if there is no
        error."""
        lengths = self.length[self.length > 0.0]
        if not len(lengths):
            return 1.0
        return round_below(max(0.1 * max(float(np.ptp(self.T, axis=0).max()), 0.1) / float(np.median(lengths)), 1.0))


def gap_with_instruments(model: Model, dataset: Dataset) -> tuple[DrawnGap, tuple[FittedInstrument, ...]]:
    """The gap of a model at a dataset, and the model's instruments.

    For a model without instruments, such as a nominal one, they are those of the dataset, and their unknowns have the values
    that fit the model best.

    Raises `DatasetError, ModelError`: as for :func:`gap_of`; also if the model is of another robot.
    """
    check_same_robot(model.robot, dataset)
    model = replace(model, geometry=replace(model.geometry, robot=measuring(model.robot, dataset)))
    dataset = _checked(model, dataset)
    fitted = model.instruments
    if not fitted:
        whole = single(dataset, model.robot)
        poses = model.predict(whole.q, whole.covariates)
        if poses.reached.any():
            readings, poses = Readings.of(whole.take(poses.reached), model.robot), poses[poses.reached]
            fitted = with_unknowns(readings.at(readings.start(poses)), poses).fitted
    return gap_of(model, dataset, fitted), fitted


def _checked(model: Model, dataset: Dataset) -> Dataset:
    """The dataset without whole turns.

    Refuses commands that do not fit the robot, and a free frame that the model does not contain.
    """
    robot = model.robot
    if dataset.instrument.frame == "free" and model.frame.is_base:
        raise ModelError("the instrument stood elsewhere, and this model does not know where", hint=CALIBRATED)
    dataset = without_whole_turns(dataset, robot)
    check_commands(dataset, robot)
    return dataset


def gap_of(model: Model, dataset: Dataset, fitted: Sequence[FittedInstrument] = ()) -> DrawnGap:
    """Measured less predicted at the rows of a dataset, base frame; ``fitted``: the instruments with their unknowns.

    Raises `DatasetError` if the commands do not fit the robot, or it can reach none of the poses. `ModelError` if a
    covariate is missing that an active effect needs, the instrument's frame is free and the model does not contain it, or
    the model lacks one of the instruments. Warns: if the robot can't reach some poses: names them; they are left out.
    """
    dataset = _checked(model, dataset)
    predicted = model.predict(dataset.q, dataset.covariates)
    reached = predicted.reached
    if not reached.any():
        raise DatasetError("the robot reaches none of these poses", file=dataset.file, hint="check robot and commands")
    if not reached.all():
        names = ", ".join(dict.fromkeys(str(pose) for pose in dataset.pose[~reached]))
        warn(f"left out, can't be reached: poses {names}")
    kept, seen, frame = dataset.take(reached), predicted[reached], model.frame
    based = seen.moved(-frame.T @ frame.R, frame.R.T)
    rows, known = kept.readings, {name: value for one in fitted for name, value in one.unknowns.items()}
    count = len(kept)
    T, error, value, whitened = based.T.copy(), np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    name, unit, share = np.empty(count, dtype=object), np.empty(count, dtype=object), {}
    for i, one in enumerate(instruments_of(rows, model.robot)):
        mine = rows.rows_of(i)
        if not len(mine):
            continue
        if lacking := next((unknown.name for unknown in one.unknowns if unknown.name not in known), None):
            raise ModelError(f"the model does not know {lacking}", hint=CALIBRATED)
        u = np.array([known[unknown.name] for unknown in one.unknowns])
        residual = one.residual_at(seen[mine], u)
        first = next(c.unit for c in one.components if c.shown)
        shown = np.array([c.shown and c.unit == first for c in one.components])
        T[mine] = one.looked_at(based[mine], u)
        error[mine] = np.einsum("mci,mc->mi", one.by_pose(seen[mine], u)[:, shown, :3], residual[:, shown]) @ frame.R
        value[mine] = np.linalg.norm(residual[:, shown], axis=1)
        whitened[mine] = value[mine] / (one.declared[0] or max(float(np.sqrt((value[mine] ** 2).mean())), 1e-300))
        name[mine], unit[mine] = one.name, first
        if not one.name:
            # Each rod's share of the gap; orientations that are not measured count as free of errors.
            at = OperatingPoints(model.kinematics, kept.q, model.kinematics.forward(kept.q), kept.covariates)
            sigma = [kept.instrument.position_sigma or 0.0, kept.instrument.orientation_sigma or 0.0]
            based_left = residual @ np.kron(np.eye(residual.shape[1] // 3), frame.R)
            share = at.rod_shares(based_left, np.diag(np.repeat(sigma, 3)[: residual.shape[1]]))
    by, units = tuple(map(str, name)), tuple(map(str, unit))
    return DrawnGap(whose(model), kept.pose, rows.line, kept.q, T, error, share, by, value, units, whitened)


def whose(model: Model) -> str:
    """Text after "errors" that says of which model they are."""
    if model.effects:
        return "after the causes"
    return "of the nominal model" if model.covariance is None else "of the calibrated geometry"
