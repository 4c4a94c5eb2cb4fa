"""Identify a robot's geometry from a dataset."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.calibration import weights
from gtpin.calibration.paper_models import MEASURED, model_geometry
from gtpin.calibration.problem import Measured, rough_frame
from gtpin.calibration.result import Calibration
from gtpin.calibration.rounds import Progress, Rounds, Settled
from gtpin.data import Dataset, check_plausible
from gtpin.errors import DatasetError, GtpinWarning, ModelError, RobotError
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import from_quaternions
from gtpin.model import Frame, Model
from gtpin.robot.geometry import Geometry
from gtpin.robot.library import load_robot
from gtpin.robot.parameters import KINDS, TOLERANCE, Per
from gtpin.robot.robot import Robot

Mask = npt.NDArray[np.bool_]

FAR = 0.01
"""Median position error after a fit, m, that no calibrated robot shows."""
MISFIT = 10.0
"""Size of the residuals over the noise that is worth a warning."""
STRAYED = 6.0
"""Deviation of a parameter from nominal, in tolerances, that is worth a warning."""


def calibrate(
    dataset: Dataset,
    robot: Robot | None = None,
    *,
    model: int | None = None,
    orientations: bool = False,
    directions: Per = "actuator",
    scale: Per | None = None,
    without: Iterable[str] = (),
    progress: Progress | None = None,
) -> Calibration:
    """Identify joint offsets, rod lengths and track geometry by Gauss-Newton with manufacturing tolerances as priors.

    Parameters
    ----------
    dataset
        Measured poses.
    robot
        The nominal robot; the one that the dataset names by default.
    model
        One of the paper's models 1 to 5 (see :func:`~gtpin.calibration.paper_models.model_geometry`) in place of the
        parameters that the next three choose. They leave out by design what others hold, so the noise is estimated from what
        they leave, whatever was declared.
    orientations
        Whether models 2, 4 and 5 take the carts' measured turning along their tracks too.
    directions, scale, without
        Which parameters: see :meth:`~gtpin.robot.geometry.Geometry.nominal`. The default for the Gantry-Tau is the 48 of
        joints, lengths and one direction per cart.
    progress
        Called with what is being done, the iteration, and the size of the residuals in units of the noise.

    Returns
    -------
    calibration
        Values, sigmas, what was learned, and the calibrated model.

    Raises
    ------
    DatasetError
        If the dataset can't be one of this robot, or is too small.
    ConvergenceError
        If the fit does not converge.

    Warns
    -----
    GtpinWarning
        Of poses that are set aside, by name.
    """
    robot = _robot_of(dataset) if robot is None else robot
    _check_tolerances(dataset)
    if model is None:
        geometry = Geometry.nominal(
            robot, directions=directions, scale=scale, tolerance=dataset.tolerance, without=without
        )
    else:
        if orientations and model not in MEASURED:
            raise ModelError(
                f"model {model} has no measured tracks to turn", hint="use 2, 4 or 5, or leave orientations out"
            )
        geometry = model_geometry(model, _with_actuators_of(robot, dataset)[0], dataset, orientations=orientations)
        dataset = without_sigmas(dataset)
    return calibrate_geometry(dataset, geometry, progress)


def calibrate_geometry(dataset: Dataset, geometry: Geometry, progress: Progress | None = None) -> Calibration:
    """Identify any geometry's parameters; see :func:`calibrate`. A reduced arm is fitted to positions alone."""
    nominal = Model(geometry)
    poses = nominal.kinematics.forward(_with_actuators_of(nominal.robot, dataset)[1].q)
    reached = _plausible(dataset, nominal, poses)
    kept, poses = dataset.take(reached), poses[reached]
    _check_spread(kept)
    measured = measured_poses(replace(kept, orientation=None) if geometry.reduced else kept)
    free = dataset.instrument.frame == "free"
    _check_size(dataset, measured, len(geometry.parameters) + (6 if free else 0))
    start = Model(geometry, rough_frame(poses, measured) if free else Frame())
    settled = Rounds(start, measured, kept.visits, poses, kept.instrument, progress).run()
    if not settled.used.all():
        named = ", ".join(dict.fromkeys(str(pose) for pose in kept.pose[~settled.used]))
        warnings.warn(f"set aside as gross errors: poses {named}", GtpinWarning, stacklevel=2)
    _check_fit(dataset, settled, start.seen(poses))
    aside = np.ones(len(dataset), dtype=bool)
    aside[np.flatnonzero(reached)[settled.used]] = False
    rejected = tuple(dict.fromkeys(str(pose) for pose in dataset.pose[aside]))
    return Calibration.of(settled, start.seen(poses[settled.used]), rejected)


def _check_fit(dataset: Dataset, settled: Settled, nominal: Poses) -> None:
    """Refuse data that calibration does not bring near the robot, and warn of a fit that hardly deserves the name."""
    problem, point = settled.fit.problem, settled.fit.point
    model, measured = point.model, problem.measured
    left, before = (
        float(np.median(np.linalg.norm(measured.T - predicted.T, axis=1)))
        for predicted in (model.seen(point.poses), nominal[settled.used])
    )
    if left > FAR and left > 0.25 * before:
        raise DatasetError(
            f"calibration leaves {left * 1e3:.3g} mm of {before * 1e3:.3g} mm: these can't be the robot's poses",
            file=dataset.file,
            hint='check the order and signs of columns, and whether the instrument stood elsewhere (frame = "free")',
        )
    size = weights.robust_scale(settled.fit.residual)
    if size > MISFIT:
        warnings.warn(
            f"residuals are {size:.0f} times the noise: the geometry does not explain these data",
            GtpinWarning,
            stacklevel=3,
        )
    x = point.x[: problem.n_geometry]
    # How a measured track is rolled about itself is guessed from where targets sat on carts: no tolerance of the machine's.
    rolled = np.array([p.kind == "direction" and p.component == 2 for p in model.geometry.parameters])
    far = np.flatnonzero((np.abs(x) > STRAYED) & ~rolled)
    strayed = [f"{model.geometry.names[i]} ({x[i]:+.0f})" for i in far[np.argsort(-np.abs(x[far]))]]
    if strayed:
        warnings.warn(
            f"parameters more than {STRAYED:g} tolerances from nominal: {', '.join(strayed[:5])}",
            GtpinWarning,
            stacklevel=3,
        )


def _robot_of(dataset: Dataset) -> Robot:
    try:
        return load_robot(dataset.robot_reference)
    except RobotError as error:
        if error.file is not None:
            raise
        raise DatasetError(error.what, file=_toml(dataset), column="robot", hint=error.hint) from None


def _check_tolerances(dataset: Dataset) -> None:
    for kind in dataset.tolerance:
        if kind not in KINDS:
            hint = f"kinds are {', '.join(TOLERANCE)}"
            raise DatasetError("unknown kind of tolerance", file=_toml(dataset), column=f"tolerance.{kind}", hint=hint)


def _toml(dataset: Dataset) -> Path | None:
    return None if dataset.path is None else dataset.path / "dataset.toml"


def without_sigmas(dataset: Dataset) -> Dataset:
    """The dataset with its noise undeclared: for models that leave something out by design, which must weigh by it."""
    undeclared = dataset.instrument.model_copy(update={"position_sigma": None, "orientation_sigma": None})
    return replace(dataset, instrument=undeclared)


def measured_poses(dataset: Dataset) -> Measured:
    """A dataset's poses, with rotations as matrices."""
    R = None if dataset.orientation is None else from_quaternions(dataset.orientation)
    return Measured(dataset.q, dataset.position, R)


def _with_actuators_of(robot: Robot, dataset: Dataset) -> tuple[Robot, Dataset]:
    if dataset.n_actuators != robot.n_actuators:
        raise DatasetError(
            f"{dataset.n_actuators} commands a pose, but {robot.name} has {robot.n_actuators} actuators",
            file=dataset.file,
            hint=f"give q1 .. q{robot.n_actuators}",
        )
    return robot, dataset


def _plausible(dataset: Dataset, nominal: Model, poses: Poses) -> Mask:
    """(N,) the rows that the robot can reach; an error where the data can't be the robot's."""
    robot, geometry = nominal.robot, nominal.geometry
    outside = geometry.outside_tracks(dataset.q)
    if outside.any():
        named = ", ".join(dict.fromkeys(str(pose) for pose in dataset.pose[outside]))
        warnings.warn(f"set aside, outside the measured tracks: poses {named}", GtpinWarning, stacklevel=4)
        if outside.all():
            raise DatasetError(
                "no pose lies within the measured tracks", file=dataset.file, hint="measure them farther"
            )
        poses.T[outside], poses.R[outside] = poses.T[~outside][0], poses.R[~outside][0]
    lengths = [p.tolerance for p in geometry.parameters if p.unit == "m"]
    if geometry.reduced:
        dataset = replace(dataset, orientation=None)
    plausible = check_plausible(
        dataset,
        names=robot.sites,
        lower=robot.lower,
        upper=robot.upper,
        revolute=robot.revolute,
        predicted_position=poses.T,
        predicted_rotation=poses.R,
        reach=max(0.05, 50.0 * max(lengths, default=0.0)),
    )
    return np.asarray(plausible & ~outside)


def _check_spread(dataset: Dataset) -> None:
    if (np.ptp(dataset.q, axis=0) == 0.0).all():
        raise DatasetError(
            "all usable rows have the same commands", file=dataset.file, hint="measure poses all over the workspace"
        )


def _check_size(dataset: Dataset, measured: Measured, unknowns: int) -> None:
    numbers = len(measured.T) * measured.components
    if numbers <= unknowns:
        raise DatasetError(
            f"{len(measured.T)} usable rows give {numbers} numbers for {unknowns} parameters",
            file=dataset.file,
            hint=f"measure at least {unknowns // measured.components + 1} poses, or leave parameters out",
        )
