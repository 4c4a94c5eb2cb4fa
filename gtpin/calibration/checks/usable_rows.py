"""Which rows of measured poses a calibration can use; an error where they can't be the robot's, by what a quick fit leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.mixed_units import check_mixed_units
from gtpin.calibration.checks.moved_sessions import check_sessions
from gtpin.calibration.checks.readable_readings import check_distances
from gtpin.calibration.checks.recognise import ALLOWED, FITS, REACHED, Interpretation, recognised
from gtpin.calibration.checks.suspected import NO_FIT, PLAUSIBLE, Size, refuse, suspect
from gtpin.calibration.free_target import with_target
from gtpin.calibration.gauss_newton import fit
from gtpin.calibration.problem import Measured, Problem, measured_poses, rough_frame, with_unknowns
from gtpin.data import Dataset, InstrumentSection, check_commands
from gtpin.data.files import warn_of
from gtpin.data.names import ORIENTATION
from gtpin.data.plausible import named_poses
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.frame_and_target import MEDIAN
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Frame, Model
from gtpin.noise import weights
from gtpin.robot.geometry import Geometry
from gtpin.typing import Mask

ROWS = 150
"""Number of rows that are enough. Assumed."""
FEWEST_ROWS = 6
"""Number of rows below which nothing is fitted."""
COARSE = 1e-3
"""Noise, m and rad, of the first fit: with less, the cost is a narrow curved valley far from its minimum."""
FAR_TOLERANCES, FAR = 50.0, {"m": 0.02, "rad": 0.05}
"""Deviation of a parameter from nominal, in units of its tolerance, and in m and rad, that no machine has. Assumed: a fit that
needs more makes up for a mistake."""
STEPS = 15
"""Largest number of steps of each fit."""


def plausible_rows(dataset: Dataset, nominal: Model, poses: Poses) -> Mask:
    """(N,) True for the rows that the robot can reach; `DatasetError` if the data can't be this robot's.

    ``poses``: those of ``nominal`` at the rows' commands, base frame.
    """
    robot, geometry = nominal.robot, nominal.geometry
    outside = geometry.outside(dataset.q)
    if outside.any():
        warn(f"set aside, outside the measured tracks: poses {', '.join(dataset.names_of(outside))}")
        if outside.all():
            raise DatasetError(
                "no pose lies within the measured tracks", file=dataset.file, hint="measure them farther"
            )
        poses.T[outside], poses.R[outside] = poses.T[~outside][0], poses.R[~outside][0]
    if geometry.positions_only:
        dataset = replace(dataset, orientation=None)
    inside, seen = dataset.take(~outside), poses[~outside]
    check_mixed_units(inside, seen)
    check_sessions(inside, nominal, seen)
    if poses.reached.mean() <= REACHED:
        check_other_readings(dataset, nominal, poses, ~outside)

    def doubt(error: DatasetError, corrected: Dataset) -> None:
        suspect(
            error, dataset, *(left_after_fit(nominal, measured_poses(d), d.instrument) for d in (dataset, corrected))
        )

    try:
        check_commands(
            dataset, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute, suspect=doubt
        )
    except DatasetError:
        check_other_readings(dataset, nominal, poses, ~outside)  # the measurements may show which unit it is
        raise
    there = poses.reached
    if not there.any():
        hint = "check that dataset.toml names the robot that was measured"
        raise DatasetError("the robot can reach none of the poses", file=dataset.file, hint=hint)
    check_other_readings(dataset, nominal, poses, there & ~outside)
    if not there.all():
        warn_of(dataset.file, f"set aside, for the robot can't reach them: {named_poses(dataset, ~there)}")
    return np.asarray(there & ~outside)


def check_other_readings(
    dataset: Dataset, nominal: Model, poses: Poses, rows: Mask | slice = slice(None), *, failed: bool = False
) -> None:
    """Suspect a usual mistake where data only fit the nominal robot when they are read in another way than the format's.

    ``poses``: (N) those of ``nominal`` at the dataset's rows, base frame. ``rows``: those that are used. ``failed``: whether a
    fit of them has failed.
    """
    looks = _looks(dataset, nominal, poses, rows, failed=failed)
    if looks is None:
        return
    error = DatasetError(looks.looks, file=dataset.file, column=looks.columns, hint=looks.hint)
    free = dataset.instrument.frame == "free" or looks.elsewhere
    read = dataset.instrument.model_copy(update={"frame": "free"}) if free else dataset.instrument
    before = left_after_fit(nominal, measured_poses(dataset.take(rows)), dataset.instrument)
    after, turned = (
        left_after_fit(nominal, looks.corrected(nominal, free), read),
        looks.columns == " ".join(ORIENTATION),
    )
    suspect(error, dataset, before, after, exact=turned)


def _looks(
    dataset: Dataset, nominal: Model, poses: Poses, rows: Mask | slice, *, failed: bool = False
) -> Interpretation | None:
    free, target = dataset.instrument.frame == "free", dataset.instrument.target == "free"
    measured = measured_poses(dataset.take(rows))
    return recognised(nominal, poses[rows], measured, free=free, free_target=target, failed=failed)


def reach_of(geometry: Geometry) -> float:
    """Largest displacement of the TCP that deviations of the geometry within its tolerances cause, m.

    Assumed: 50 times the largest tolerance of a length, and at least 0.05 m.
    """
    lengths = [p.tolerance for p in geometry.parameters if p.unit == "m" and not p.is_free]
    return max(0.05, 50.0 * max(lengths, default=0.0))


def check_moved(dataset: Dataset, geometry: Geometry, nominal: Geometry, near: Poses, free: Mask | None) -> None:
    """Refuse a fitted geometry whose links stand elsewhere than this robot's; the error names the farthest parameter.

    That is by more than `FAR_TOLERANCES`, and more than the largest misfit that is accepted of nominal poses: a fit that needs
    so much makes up for a mistake. ``nominal``: with the tolerances as given. ``near``: (N) its poses. ``free``: (p,) True for
    the parameters of a free target; None: there are none.
    """
    size = float(np.sqrt(((near.T - near.T.mean(axis=0)) ** 2).sum(axis=1).mean()))
    off = np.abs(geometry.deviation)
    # The rotation of a measured track about itself depends on where targets were on carts: it is no error of the machine.
    off[[p.kind == "track_direction" and p.component == 2 for p in geometry.parameters]] = 0.0
    moved = off * np.array([1.0 if p.unit == "m" else size for p in geometry.parameters])
    moved[(off <= FAR_TOLERANCES * nominal.tolerance) | (False if free is None else free)] = 0.0
    if moved.max(initial=0.0) <= FITS * size + ALLOWED:
        return
    worst = geometry.parameters[int(np.argmax(moved))]
    far = f"{1e3 * geometry[worst.name] - 1e3 * worst.nominal:+.3g} {'mm' if worst.unit == 'm' else 'mrad'}"
    what = f"the fit moves {worst.name} by {far}, farther than any machine of this kind is off: the data are not this robot's"
    hint = "check the robot's file and tcp, units and signs of q1 .. qn and of what was measured, and where instruments stood"
    refuse(DatasetError(what, file=dataset.file, hint=hint), dataset)


def problem_of(dataset: Dataset, near: Poses, nominal: Model, *, free: bool) -> Problem:
    """The problem about the nominal machine, with the frame, and the instruments' unknowns, that fit it best.

    ``near``: (N) poses of ``nominal`` at the dataset's rows, base frame. ``free``: whether a lone tracker stands elsewhere.

    Raises `DatasetError` if there are fewer measured numbers than unknowns without a prior, or a known distance of sockets
    can't be the robot's.
    """
    readings = Readings.of(dataset, nominal.robot)
    readings, c = readings.at(readings.start(near)), readings.components
    numbers, unknowns = len(dataset) * c, readings.free_unknowns(free)
    if numbers <= unknowns:
        what = f"{numbers} readings for {unknowns} unknowns of the instruments alone"
        raise DatasetError(what, file=dataset.file, hint="measure more")
    check_distances(dataset, readings, near, reach_of(nominal.geometry))
    start = replace(nominal, frame=rough_frame(near, measured_poses(dataset)) if free else Frame())
    whitening = np.broadcast_to(np.eye(c), (len(dataset), c, c))
    return Problem(start, with_unknowns(readings, near), whitening, free)


def left_after_fit(nominal: Model, measured: Measured, instrument: InstrumentSection) -> Size:
    """Robust standard deviations of what a fit leaves; `NO_FIT` where it fails.

    ``nominal``: the nominal model; a free target is placed anew. ``measured``: the measured poses. ``instrument``: says
    what is free, and which noise is declared.
    """
    some = np.linspace(0, len(measured.T) - 1, min(len(measured.T), ROWS)).astype(int)
    measured, free = measured.take(some), instrument.frame == "free"
    if instrument.target == "free":
        nominal = replace(nominal, geometry=with_target(nominal.geometry, measured, free_frame=free)[0])
    poses = nominal.kinematics.forward(measured.q)
    there = poses.reached
    if there.sum() < FEWEST_ROWS or there.mean() <= REACHED:
        return NO_FIT
    measured, poses = measured.take(there), poses[there]
    start = replace(nominal, frame=rough_frame(poses, measured) if free else Frame())
    last = (instrument.position_sigma or PLAUSIBLE[0], instrument.orientation_sigma or PLAUSIBLE[1])
    readings, c = Readings.of_poses(measured.q, measured.T, measured.R, nominal.robot), measured.components
    x = None
    try:
        for sigmas in ((COARSE, COARSE), last):
            whitening = np.diag(1.0 / np.repeat(sigmas, 3)[:c])
            problem = Problem(start, readings, np.broadcast_to(whitening, (len(poses), c, c)), free)
            found = fit(problem, weights.huber, x, near=poses, enough=STEPS)
            x, poses = found.point.x, found.point.poses
    except (ConvergenceError, np.linalg.LinAlgError):
        return NO_FIT
    off = np.abs(found.point.x[: found.problem.n_geometry])
    farthest = np.array([FAR.get(p.unit, np.inf) for p in nominal.geometry.parameters])
    if ((off > FAR_TOLERANCES) & (off * nominal.geometry.tolerance > farthest)).any():
        return NO_FIT  # another robot
    residual = measured.residual_at(found.point.model.in_instrument_frame(poses))
    position, rotation = (float(np.median(np.linalg.norm(part, axis=1))) for part in (residual[:, :3], residual[:, 3:]))
    return position / MEDIAN, rotation / MEDIAN
