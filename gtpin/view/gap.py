"""The gap of a model at the poses of a dataset, for drawings: errors in the base frame, and each rod's share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import measured_poses
from gtpin.data import Dataset, check_commands
from gtpin.effects.situation import Situation
from gtpin.errors import DatasetError, ModelError, warn
from gtpin.model.model import Model
from gtpin.typing import Floats


@dataclass(frozen=True)
class Gap:
    """Measured less predicted positions at N poses of a dataset, base frame.

    Parameters
    ----------
    whose
        Text after "errors" that says of which model they are, such as "of the nominal model".
    pose, row
        (N,) the poses' ids, and their lines in the dataset's table.
    q
        (N, n) commands, m or rad.
    T
        (N, 3) predicted positions of the TCP, m.
    error
        (N, 3) measured less predicted position, m.
    share
        By site, each rod's share, 0 to 1, of the mean squared error that exceeds the declared noise, with errors mapped to
        lengths of the rods; empty for a robot without rods.
    """

    whose: str
    pose: npt.NDArray[np.object_]
    row: npt.NDArray[np.int64]
    q: Floats
    T: Floats
    error: Floats
    share: dict[str, float]

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
        """Each pose's id, and its row in the table: no two are the same."""
        return [f"{pose} (row {row})" for pose, row in zip(self.pose, self.row, strict=True)]

    @property
    def size(self) -> Floats:
        """(N,) sizes of the errors, by which they are coloured and compared: their lengths, m."""
        return self.length

    @property
    def what(self) -> str:
        """Text: the kind of the errors, and the model that they are of."""
        return f"position errors {self.whose}"

    @property
    def summary(self) -> str:
        """Text: root mean square of the errors, and number of poses."""
        return f"{1e6 * self.rms:,.0f} µm RMS at {len(self.q)} poses"

    def said(self, index: int) -> str:
        """Text with the size of one error."""
        return f"off by {1e6 * self.length[index]:,.1f} µm"

    def magnification(self) -> float:
        """A round factor for drawings: with it, the median error is at most a tenth of the workspace. 1 if there is no
        error."""
        lengths = self.length[self.length > 0.0]
        if not len(lengths):
            return 1.0
        usual = float(np.median(lengths))
        wanted = max(0.1 * max(float(np.ptp(self.T, axis=0).max()), 0.1) / usual, 1.0)
        power = 10.0 ** np.floor(np.log10(wanted))
        return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted))


def gap_of(model: Model, dataset: Dataset) -> Gap:
    """Measured less predicted positions at the poses of a dataset, base frame.

    Raises
    ------
    DatasetError
        If the commands do not fit the robot, or it can reach none of the poses.
    ModelError
        If a covariate is missing that an active effect needs, or the instrument's frame is free and the model does not contain
        it.

    Warns
    -----
    GtpinWarning
        If the robot can't reach some poses: names them; they are left out.
    """
    robot = model.robot
    if dataset.instrument.frame == "free" and model.frame.is_base:
        hint = "give the model that gtpin calibrate makes of these data"
        raise ModelError("the instrument stood elsewhere, and this model does not know where", hint=hint)
    check_commands(dataset, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute)
    predicted = model.predict(dataset.q, dataset.covariates)
    reached = predicted.reached
    if not reached.any():
        raise DatasetError("the robot reaches none of these poses", file=dataset.file, hint="check robot and commands")
    if not reached.all():
        names = ", ".join(dict.fromkeys(str(pose) for pose in dataset.pose[~reached]))
        warn(f"left out, can't be reached: poses {names}")
    kept = dataset.take(reached)
    there, frame = predicted[reached], model.frame
    left = measured_poses(kept).minus(there)
    error = left @ np.kron(np.eye(left.shape[1] // 3), frame.R)
    return Gap(
        whose(model),
        kept.pose,
        kept.row,
        kept.q,
        (there.T - frame.T) @ frame.R,
        error[:, :3],
        _shares(model, kept, error),
    )


def whose(model: Model) -> str:
    """Text after "errors" that says of which model they are."""
    if model.effects:
        return "after the causes"
    return "of the nominal model" if model.covariance is None else "of the calibrated geometry"


def _shares(model: Model, dataset: Dataset, error: Floats) -> dict[str, float]:
    """Each rod's share of the gap, with errors mapped to the rods by the inverse of the closures' Jacobian.

    Orientations that are not measured count as free of errors.
    """
    kinematics, robot = model.kinematics, model.robot
    if not robot.rod_sites:
        return {}
    at = Situation(kinematics, dataset.q, kinematics.forward(dataset.q), dataset.covariates)
    to_rods = np.linalg.inv(at.response[:, :6])[:, :, : error.shape[1]]
    declared = dataset.instrument
    sigma = np.repeat([declared.position_sigma or 0.0, declared.orientation_sigma or 0.0], 3)[: error.shape[1]]
    power = (np.einsum("nkc,nc->nk", to_rods, error) ** 2).mean(axis=0) - ((to_rods * sigma) ** 2).sum(axis=2).mean(
        axis=0
    )
    power = np.maximum(power, 0.0)
    total = float(power.sum())
    return {site: float(p / total) if total > 0.0 else 0.0 for site, p in zip(robot.rod_sites, power, strict=True)}
