"""Which rows of a dataset a calibration can use; an error where they can't be the robot's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.mixed_units import check_mixed_units
from gtpin.calibration.checks.moved_sessions import check_sessions
from gtpin.calibration.checks.recognise import REACHED, Reading, recognised
from gtpin.calibration.checks.suspected import suspect
from gtpin.calibration.checks.trial import left_after_fit, left_in
from gtpin.calibration.problem import Measured, measured_poses
from gtpin.data import Dataset, check_commands, check_measurements
from gtpin.data.names import ORIENTATION
from gtpin.errors import DatasetError, warn
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry
from gtpin.typing import Mask

FEWEST = 1.0
"""Fewest degrees of freedom (measured numbers less the effective number of parameters) of a fit that can be checked."""


def plausible_rows(dataset: Dataset, nominal: Model, poses: Poses) -> Mask:
    """(N,) True for the rows that the robot can reach; `DatasetError` if the data can't be this robot's.

    ``poses``: those of ``nominal`` at the rows' commands, base frame.
    """
    robot, geometry = nominal.robot, nominal.geometry
    outside = geometry.outside_tracks(dataset.q)
    if outside.any():
        named = ", ".join(dict.fromkeys(str(pose) for pose in dataset.pose[outside]))
        warn(f"set aside, outside the measured tracks: poses {named}")
        if outside.all():
            raise DatasetError(
                "no pose lies within the measured tracks", file=dataset.file, hint="measure them farther"
            )
        poses.T[outside], poses.R[outside] = poses.T[~outside][0], poses.R[~outside][0]
    if geometry.reduced:
        dataset = replace(dataset, orientation=None)
    inside, seen = dataset.take(~outside), poses[~outside]
    check_mixed_units(inside, seen)
    check_sessions(inside, nominal, measured_poses(inside), seen)
    if poses.reached.mean() <= REACHED:
        _check_readings(dataset, nominal, poses, ~outside)

    def doubt(error: DatasetError, corrected: Dataset) -> None:
        turned = error.column == " ".join(ORIENTATION)
        if turned:
            alone = replace(dataset, orientation=None)
            if _looks(alone, nominal, poses, ~outside):  # where positions do not fit either, the order is not known
                _check_readings(dataset, nominal, poses, ~outside)
                _check_readings(alone, nominal, poses, ~outside)
                return
        left = (left_in(rows, nominal, measured_poses(rows)) for rows in (dataset, corrected))
        suspect(error, dataset, *left, exact=turned)

    try:
        check_commands(
            dataset,
            names=robot.sites,
            lower=robot.lower,
            upper=robot.upper,
            revolute=robot.revolute,
            suspect=doubt,
        )
    except DatasetError:
        _check_readings(dataset, nominal, poses, ~outside)  # the measurements may show which unit it is
        raise
    plausible = check_measurements(
        dataset, predicted_position=poses.T, predicted_rotation=poses.R, reach=reach_of(geometry), suspect=doubt
    )
    _check_readings(dataset, nominal, poses, plausible & ~outside)
    return np.asarray(plausible & ~outside)


def _check_readings(dataset: Dataset, nominal: Model, poses: Poses, rows: Mask) -> None:
    """Suspect a usual mistake where data only fit the nominal robot when they are read in another way than the format's."""
    looks = _looks(dataset, nominal, poses, rows)
    if looks is None:
        return
    error = DatasetError(looks.looks, file=dataset.file, column=looks.columns, hint=looks.hint)
    free = dataset.instrument.frame == "free" or looks.elsewhere
    read = dataset.instrument.model_copy(update={"frame": "free"}) if free else dataset.instrument
    before = left_in(dataset, nominal, measured_poses(dataset.take(rows)))
    suspect(error, dataset, before, left_after_fit(nominal, looks.corrected(nominal, free), read))


def _looks(dataset: Dataset, nominal: Model, poses: Poses, rows: Mask) -> Reading | None:
    known = dataset.instrument
    measured = measured_poses(dataset.take(rows))
    return recognised(nominal, poses[rows], measured, free=known.frame == "free", free_target=known.target == "free")


def reach_of(geometry: Geometry) -> float:
    """Largest displacement of the TCP that deviations of the geometry within its tolerances cause, m.

    Assumed: 50 times the largest tolerance of a length, and at least 0.05 m.
    """
    lengths = [p.tolerance for p in geometry.parameters if p.unit == "m"]
    return max(0.05, 50.0 * max(lengths, default=0.0))


def check_size(dataset: Dataset, measured: Measured, unknowns: int) -> None:
    """Raise `DatasetError` if there are fewer measured numbers than unknowns without a prior: those of a free frame."""
    numbers = len(measured.T) * measured.components
    if numbers <= unknowns:
        raise DatasetError(
            f"{len(measured.T)} usable rows give {numbers} numbers for {unknowns} unknowns of the instrument alone",
            file=dataset.file,
            hint="measure more poses",
        )


def check_freedom(dataset: Dataset, numbers: float, dof: float) -> None:
    """Raise `DatasetError` if a fit leaves less than one degree of freedom: nothing could be said of its noise or its error."""
    if dof < FEWEST:
        raise DatasetError(
            f"{numbers:g} measured numbers leave {max(dof, 0.0):.2g} degrees of freedom",
            file=dataset.file,
            hint="measure more: a fit needs more numbers than it takes to fit them (of touches of one plane, about 25; a mesh "
            "of 7 x 7 is good)",
        )
