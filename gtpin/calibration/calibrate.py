"""Identify a robot's geometry from a dataset."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.of_poses import PoseChecks
from gtpin.calibration.checks.of_readings import ReadingChecks
from gtpin.calibration.checks.prepared import check_actuators, prepared
from gtpin.calibration.checks.suspected import recalled
from gtpin.calibration.checks.usable_rows import check_freedom
from gtpin.calibration.free_target import with_free_target
from gtpin.calibration.kept_effects import with_kept_effects
from gtpin.calibration.paper_models import MEASURED, model_geometry
from gtpin.calibration.result import Calibration, calibration_of
from gtpin.calibration.robust_fit import Progress, RobustFit
from gtpin.data import Dataset
from gtpin.effects.active import ActiveEffect
from gtpin.errors import DatasetError, ModelError, check_kind, noted, warn
from gtpin.memory import amount, require
from gtpin.model.measured_robot import measuring, robot_of
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import KINDS, TOLERANCE, Per
from gtpin.robot.robot import Robot
from gtpin.threads import in_one_thread

FIXED = 80e6
"""Bytes of memory that a calibration needs for any number of poses: chunks of them, and a part that is fitted first."""
PER_POSE = 1200.0
"""Bytes of memory that it needs for each pose, in addition to the dataset. Measured: 600 to 900 (docs/speed.md)."""
MANY = 100_000
"""Number of poses above which the required memory is checked first."""


@in_one_thread
def calibrate(
    dataset: Dataset,
    robot: Robot | None = None,
    *,
    model: int | None = None,
    orientations: bool = False,
    directions: Per = "actuator",
    scale: Per | None = None,
    without: Iterable[str] = (),
    kinematics: str | None = None,
    keep_effects: Iterable[ActiveEffect] = (),
    trust_data: bool = False,
    progress: Progress | None = None,
) -> Calibration:
    """Identify joint offsets, rod lengths and track geometry by Gauss-Newton with manufacturing tolerances as priors.

    Parameters
    ----------
    dataset
        Measured poses or readings.
    robot
        The nominal robot; by default the one that the dataset names.
    model
        One of models 1 to 5 of Dressler et al. 2010 (see :func:`~gtpin.calibration.paper_models.model_geometry`), in place of
        the parameters that ``directions``, ``scale`` and ``without`` choose. These models leave out known causes of deviations.
        Therefore the noise is estimated from their residuals, and declared sigmas are not used.
    orientations
        Whether models 2, 4 and 5 also use the carts' measured rotations along their tracks; not used without ``model``.
    directions, scale, without
        Choice of parameters: see :meth:`~gtpin.robot.geometry.Geometry.nominal`. The default for the Gantry-Tau is 48
        parameters: those of rod lengths and joints, and one track direction per cart.
    kinematics
        Deprecated, and not used: both former solvers gave the same result except for rounding.
    keep_effects
        Effects of an earlier model of the machine (``model.effects``), which stay as they are: the same machine with another
        tool or instrument. See :func:`~gtpin.calibration.kept_effects.with_kept_effects`.
    trust_data
        Whether checks for usual mistakes (units, signs, orders of columns) only warn, and never refuse the data.
    progress
        Called with the name of the step, the number of the iteration, and the RMS residual in units of the noise; None: no
        calls.

    Returns
    -------
    calibration
        Values, sigmas, variance reduction, and the calibrated model.

    Raises
    ------
    DatasetError
        If the dataset does not fit the robot, or is too small.
    ModelError
        If an option has another value, or does not fit the robot or the model.
    ConvergenceError
        If the fit does not converge.

    Warns
    -----
    GtpinWarning
        Names the poses whose rows are rejected as outliers, and mistakes that the data may have. ``warnings`` of the result has
        the texts.

    Examples
    --------
    >>> import gtpin
    >>> calibration = gtpin.calibrate(gtpin.Dataset.read("measured"))
    >>> calibration["length[2a]"].unit, len(calibration.names)
    ('m', 48)
    """
    check_kind(dataset, Dataset)
    check_kind(robot, Robot, type(None))
    if kinematics is not None:
        warn("calibrate: kinematics is not used any more; leave it out", DeprecationWarning)
    with noted() as texts, recalled(texts):
        found = _calibrate(
            replace(dataset, trusted=True) if trust_data else dataset,
            robot_of(dataset) if robot is None else robot,
            model=model,
            orientations=orientations,
            directions=directions,
            scale=scale,
            without=without,
            keep_effects=keep_effects,
            progress=progress,
        )
    return replace(found, dataset=dataset, paper_model=model, warnings=dataset.told(texts))


def _calibrate(
    dataset: Dataset,
    robot: Robot,
    *,
    model: int | None,
    orientations: bool,
    directions: Per,
    scale: Per | None,
    without: Iterable[str],
    keep_effects: Iterable[ActiveEffect],
    progress: Progress | None,
) -> Calibration:
    """As :func:`calibrate`."""
    _check_tolerances(dataset)
    left_out = tuple(without)
    if model is None:
        geometry = Geometry.nominal(
            robot, directions=directions, scale=scale, tolerance=dataset.tolerance, without=left_out
        )
    else:
        if orientations and model not in MEASURED:
            raise ModelError(
                f"model {model} has no measured tracks to turn", hint="use 2, 4 or 5, or leave orientations out"
            )
        check_actuators(robot, dataset)
        geometry = model_geometry(model, robot, dataset, orientations=orientations)

    def calibrated(data: Dataset) -> Calibration:
        return _calibrated(
            data if model is None else without_sigmas(data),
            geometry,
            progress,
            doubt=model is None and not left_out,
            lacking=model is not None,
        )

    kept = tuple(keep_effects)
    return with_kept_effects(dataset, kept, robot, calibrated) if kept else calibrated(dataset)


@in_one_thread
def calibrate_geometry(
    dataset: Dataset, geometry: Geometry, progress: Progress | None = None, *, lacking: bool = False
) -> Calibration:
    """Identify the parameters of a given geometry. A reduced arm is fitted to positions only.

    ``dataset``, ``progress``: as for :func:`calibrate`. ``geometry``: the nominal geometry, with the
    parameters to identify. ``lacking``: whether the geometry leaves out known causes of deviations: see
    :class:`~gtpin.calibration.robust_fit.RobustFit`.
    """
    return _calibrated(dataset, geometry, progress, doubt=False, lacking=lacking)


def _calibrated(
    dataset: Dataset, geometry: Geometry, progress: Progress | None, *, doubt: bool, lacking: bool
) -> Calibration:
    """Fit; with ``doubt``, also check the declared noise, frame and tolerances."""
    needed = FIXED + PER_POSE * len(dataset)
    require(f"calibrating {len(dataset):,} poses", needed)
    if progress is not None and len(dataset) >= MANY:
        progress(f"calibrating {len(dataset):,} poses in {amount(needed)} of memory", 0, float("nan"))
    check_actuators(geometry.robot, dataset)
    geometry = with_free_target(replace(geometry, robot=measuring(geometry.robot, dataset)), dataset)
    nominal = Model(geometry)
    data = prepared(dataset, nominal)
    checks = PoseChecks(data, nominal, doubt) if dataset.readings.tracked else ReadingChecks(data, nominal)
    usable, kept, near = checks.rows
    problem = checks.problem
    found = np.array([p.kind == "platform" for p in geometry.parameters]) if data.instrument.target == "free" else None
    settled = checks.settled(RobustFit(problem, kept.row, kept.visits, near, progress, lacking, found))
    check_freedom(data, len(kept) * problem.measured.components, settled.dof)
    return calibration_of(settled, near, checks.whole, usable)


def _check_tolerances(dataset: Dataset) -> None:
    for kind in dataset.tolerance:
        if kind not in KINDS:
            hint = f"kinds are {', '.join(TOLERANCE)}"
            toml = None if dataset.path is None else dataset.path / "dataset.toml"
            raise DatasetError("unknown kind of tolerance", file=toml, column=f"tolerance.{kind}", hint=hint)


def without_sigmas(dataset: Dataset) -> Dataset:
    """The dataset without declared noise, for models that leave out known causes: their residuals determine the weights."""
    undeclared = dataset.instrument.model_copy(update={"position_sigma": None, "orientation_sigma": None})
    return replace(dataset, instrument=undeclared)
