"""Identify a robot's geometry from readings of other instruments than one tracker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.declared_noise import settled_or_explained, with_credible_noise
from gtpin.calibration.checks.prepared import prepared
from gtpin.calibration.checks.readable_readings import Misfit, check_fitted, check_readable, explained
from gtpin.calibration.checks.readable_sockets import check_distances, check_sockets
from gtpin.calibration.checks.rejected_rows import check_used, poses_of
from gtpin.calibration.checks.strayed import warn_of_strayed
from gtpin.calibration.checks.usable_rows import check_freedom, reach_of
from gtpin.calibration.instrument_unknowns import with_unknowns
from gtpin.calibration.problem import Problem
from gtpin.calibration.result import Calibration, calibration_of
from gtpin.calibration.robust_fit import Progress, RobustFit
from gtpin.data import Dataset, check_commands
from gtpin.data.sane import sane_rows
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.readings import Readings, single
from gtpin.kinematics.kinematics import Solver
from gtpin.model.measured_robot import measuring
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry
from gtpin.typing import Mask

MISFIT = 10.0
"""Size of the residuals, in units of the noise, from which there is a warning."""


def calibrate_readings(
    dataset: Dataset, geometry: Geometry, progress: Progress | None, kinematics: Solver = "arrays"
) -> Calibration:
    """Identify the geometry, with the instruments' unknowns, from a dataset of schema 2.

    Raises `DatasetError` if the readings can't be those of this robot, or are too few. `ConvergenceError` if the fit does
    not converge. Warns: names poses whose rows are rejected, and warns of residuals that are much larger than noise.
    """
    robot = measuring(geometry.robot, dataset)
    geometry = replace(geometry, robot=robot)
    nominal = Model(geometry, solver=kinematics)
    dataset = prepared(dataset, nominal)
    check_sockets(dataset, robot)
    whole = single(dataset, robot)
    check_commands(dataset, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute)
    assert whole.readings is not None
    usable = sane_rows(whole)
    _warn_of(whole, usable & ~whole.readings.countable, "for numbers that are too large to count with")
    usable &= whole.readings.countable
    if not usable.any():
        raise DatasetError("no reading that can be counted with", file=dataset.file, hint="check the tables' units")
    poses = nominal.kinematics.forward(whole.q)
    _warn_of(whole, usable & ~poses.reached, "for the robot can't reach them")
    usable &= poses.reached
    if not usable.any():
        raise DatasetError("the robot reaches none of these commands", file=dataset.file, hint="check q1 .. qn")
    kept, near = whole.take(usable), poses[usable]
    readings = Readings.of(kept, robot)
    readings = readings.at(readings.start(near))
    free = int((~np.isfinite(readings.sigma)).sum())
    if len(kept) * readings.components <= free:
        what = f"{len(kept) * readings.components} readings for {free} unknowns of the instruments alone"
        raise DatasetError(what, file=dataset.file, hint="measure more")
    check_distances(dataset, readings, near, reach_of(geometry))
    fitted = with_unknowns(readings, near)

    def fit_of(some: Readings) -> RobustFit:
        c = some.components
        problem = Problem(nominal, some, np.broadcast_to(np.eye(c), (len(kept), c, c)))
        return RobustFit(problem, kept.row, kept.visits, near, progress)

    def misfit(some: Readings, index: int) -> Misfit | None:
        try:
            fit = fit_of(some).run().fit
        except ConvergenceError:
            return None
        return Misfit.of(fit.problem.readings(fit.point.x), fit.point.poses, index)

    check_readable(dataset, fitted, near, reach_of(geometry), misfit)
    with explained(fitted, near):
        fit = fit_of(fitted)
        settled = with_credible_noise(fit, settled_or_explained(fit))[1]
    check_used(kept, fitted, settled.used)
    check_freedom(dataset, len(kept) * readings.components, settled.dof)
    problem, point = settled.fit.problem, settled.fit.point
    check_fitted(dataset, problem.readings(point.x), point.poses, reach_of(geometry))
    if settled.scale > MISFIT:
        scale = f"residuals are {settled.scale:.0f} times the noise"
        warn(f"{scale}: the geometry does not explain these data, or the declared sigma is too small")
    found = calibration_of(settled, near, whole, usable, dataset)
    x = settled.fit.point.x[: len(geometry.parameters)]
    warn_of_strayed(x, geometry, found.observability, fitted.at(found.u))
    return found


def _warn_of(dataset: Dataset, rows: Mask, why: str) -> None:
    if rows.any():
        warn(f"set aside, {why}: {poses_of(dataset.pose[rows])}")
