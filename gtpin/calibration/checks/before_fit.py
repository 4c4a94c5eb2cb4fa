"""What a calibration starts from: rows that it can use; an error where they can't be the robot's, by what a quick fit leaves.

This includes positions that are in another unit than metres in a part of the rows.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gtpin.calibration.checks import limits
from gtpin.calibration.checks.instruments import check_distances, check_sockets, check_stations
from gtpin.calibration.checks.moved import check_sessions
from gtpin.calibration.checks.readings import UNITS
from gtpin.calibration.checks.recognise import recognised
from gtpin.calibration.checks.suspected import NO_FIT, Size, about_track, refuse, suspect
from gtpin.calibration.gauss_newton import fit
from gtpin.calibration.problem import (
    Measured,
    Problem,
    measured_poses,
    problem_of,
    rough_frame,
    with_free_target,
    with_target,
)
from gtpin.data import Dataset, InstrumentSection
from gtpin.data.files import warn_of
from gtpin.data.names import ORIENTATION
from gtpin.data.plausible import check_extremes, counted_once, named_poses, sane_rows, with_rounding
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.frame_and_target import MEDIAN, nearest
from gtpin.instruments.readings import Readings, single
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import log
from gtpin.model.measured_robot import measuring, robot_of
from gtpin.model.model import Frame, Model
from gtpin.noise import weights
from gtpin.noise.noise import Noise
from gtpin.robot.chain import Chain
from gtpin.robot.command_ranges import check_actuators, check_commands, without_whole_turns
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Mask


class Fittable(NamedTuple):
    """What a fit starts from.

    ``data``: the dataset without copies. ``whole``: the same with the noise that rounding adds, or with equally many numbers in
    each row. ``usable``: (N,) its rows that the robot can have reached. ``kept``: these rows. ``near``: their nominal poses,
    base frame. ``problem``: about the nominal machine. ``tracked``: whether one tracker measured poses.
    """

    data: Dataset
    whole: Dataset
    usable: Mask
    kept: Dataset
    near: Poses
    problem: Problem
    tracked: bool


def fittable(dataset: Dataset, geometry: Geometry) -> Fittable:
    """What a fit of a dataset starts from; errors and warnings of all checks of the data before a fit."""
    check_actuators(geometry.robot, dataset)
    nominal = Model(with_free_target(replace(geometry, robot=measuring(geometry.robot, dataset)), dataset))
    data, tracked, robot = prepared(dataset, nominal), dataset.readings.tracked, nominal.robot
    if tracked:
        whole = with_rounding(data)
        usable = sane_rows(whole)
        poses = nominal.kinematics.forward(whole.q[usable])
        plausible = plausible_rows(whole.take(usable), nominal, poses)
        usable[usable] = plausible
        kept, near = whole.take(usable), poses[plausible]
        kept = replace(kept, orientation=None) if geometry.positions_only else kept
        problem = problem_of(kept, near, nominal, free=data.instrument.frame == "free")
        return Fittable(data, whole, usable, kept, near, problem, tracked)
    check_sockets(data, robot)
    check_stations(data)
    whole = single(data, robot)
    check_commands(data, robot)
    poses, usable = nominal.kinematics.forward(whole.q), sane_rows(whole)
    countable = "for numbers that are too large to count with", "no reading that can be counted with"
    reached = "because the robot can't reach them", "the robot reaches none of these commands"
    for good, (why, what), hint in (
        (whole.readings.countable, countable, "check the tables' units"),
        (poses.reached, reached, "check q1 .. qn"),
    ):
        if (usable & ~good).any():
            warn(f"set aside, {why}: {named_poses(whole, usable & ~good)}")
        usable &= good
        if not usable.any():
            raise DatasetError(what, file=whole.file, hint=hint)
    kept, near = whole.take(usable), poses[usable]
    check_distances(kept, robot, near, reach_of(nominal.geometry))
    return Fittable(data, whole, usable, kept, near, problem_of(kept, near, nominal, free=False), tracked)


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


def plausible_rows(dataset: Dataset, nominal: Model, poses: Poses) -> Mask:
    """(N,) True for the rows that the robot can reach; `DatasetError` if the data can't be this robot's.

    ``poses``: those of ``nominal`` at the rows' commands, base frame.
    """
    robot, geometry = nominal.robot, nominal.geometry
    outside = geometry.outside(dataset.q)
    if outside.any():
        warn(f"set aside, outside the measured tracks: poses {', '.join(dataset.names_of(outside))}")
        if outside.all():
            hint = "measure them farther"
            raise DatasetError("no pose lies within the measured tracks", file=dataset.file, hint=hint)
        poses.T[outside], poses.R[outside] = poses.T[~outside][0], poses.R[~outside][0]
    if geometry.positions_only:
        dataset = replace(dataset, orientation=None)
    inside, seen = dataset.take(~outside), poses[~outside]
    check_mixed_units(inside, seen)
    check_sessions(inside, nominal, seen)
    if poses.reached.mean() <= limits.REACHED:
        check_other_readings(dataset, nominal, poses, ~outside)

    def doubt(error: DatasetError, corrected: Dataset) -> None:
        left = (left_after_fit(nominal, measured_poses(d), d.instrument) for d in (dataset, corrected))
        suspect(error, dataset, *left)

    try:
        check_commands(dataset, robot, doubt)
    except DatasetError:
        check_other_readings(dataset, nominal, poses, ~outside)  # the measurements may show which unit it is
        raise
    there = poses.reached
    if not there.any():
        hint = "check that dataset.toml names the robot that was measured"
        if geometry.held:
            hint += f", and the values at which {', '.join(p.name for p, _ in geometry.held)} are held"
        raise DatasetError("the robot can reach none of the poses", file=dataset.file, hint=hint)
    check_other_readings(dataset, nominal, poses, there & ~outside)
    if not there.all():
        warn_of(dataset.file, f"set aside, because the robot can't reach them: {named_poses(dataset, ~there)}")
    return np.asarray(there & ~outside)


def check_other_readings(
    dataset: Dataset, nominal: Model, poses: Poses, rows: Mask | slice = slice(None), *, failed: bool = False
) -> None:
    """Suspect a usual mistake where data only fit the nominal robot when they are read in another way than the format's.

    ``poses``: (N) those of ``nominal`` at the dataset's rows, base frame. ``rows``: those that are used. ``failed``: whether a
    fit of them has failed.
    """
    instrument, measured = dataset.instrument, measured_poses(dataset.take(rows))
    looks = recognised(nominal, poses[rows], measured, instrument, failed=failed)
    if looks is None:
        return
    error = DatasetError(looks.looks, file=dataset.file, column=looks.columns, hint=looks.hint)
    read = instrument.model_copy(update={"frame": "free"}) if looks.elsewhere else instrument
    before, after = left_after_fit(nominal, measured, instrument), left_after_fit(nominal, looks.measured, read)
    suspect(error, dataset, before, after, exact=looks.columns == " ".join(ORIENTATION))


def reach_of(geometry: Geometry) -> float:
    """Largest displacement of the TCP that deviations of the geometry within its tolerances cause, m.

    Assumed: 50 times the largest tolerance of a length, and at least 0.05 m.
    """
    lengths = [p.tolerance for p in geometry.parameters if p.unit == "m" and not p.is_free]
    return max(0.05, 50.0 * max(lengths, default=0.0))


def check_moved(dataset: Dataset, geometry: Geometry, nominal: Geometry, near: Poses, free: Mask | None) -> None:
    """Refuse a fitted geometry whose links stand elsewhere than this robot's; the error names the farthest parameter.

    The arguments are those of :func:`moved_too_far`.
    """
    if far := moved_too_far(geometry, nominal, near, free):
        what = f"the fit moves {far}, farther than any machine of this kind is off: the data are not this robot's"
        hint = "check the robot's file and tcp, units and signs of q1 .. qn and of what was measured, where instruments stood"
        if far.startswith("platform."):
            target = 'if the target does not sit at the TCP, set target = "free" under [instrument]'
            hint = f"{target}, or write where it sits"
        refuse(DatasetError(what, file=dataset.file, hint=hint), dataset)


def moved_too_far(geometry: Geometry, nominal: Geometry, near: Poses, free: Mask | None) -> str:
    """The parameter of a fitted geometry that is farthest from nominal, and by how much, if no machine is so far off; else "".

    That is by more than `limits.ANOTHER_TOLERANCES`, and more than the largest misfit that is accepted of nominal poses: a
    fit that needs so much makes up for a mistake. ``nominal``: with the tolerances as given. ``near``: (N) its poses.
    ``free``: (p,) True for the parameters of a free target; None: there are none.
    """
    size = float(np.sqrt(((near.T - near.T.mean(axis=0)) ** 2).sum(axis=1).mean()))
    off = np.where(about_track(geometry), 0.0, np.abs(geometry.deviation))
    moved = off * np.array([1.0 if p.unit == "m" else size for p in geometry.parameters])
    moved[(off <= limits.ANOTHER_TOLERANCES * nominal.tolerance) | (False if free is None else free)] = 0.0
    if moved.max(initial=0.0) <= limits.ACCEPTED * size + limits.ALLOWED:
        return ""
    worst = geometry.parameters[int(np.argmax(moved))]
    return f"{worst.name} by {1e3 * geometry[worst.name] - 1e3 * worst.nominal:+.3g} {'mm' if worst.unit == 'm' else 'mrad'}"


def left_after_fit(nominal: Model, measured: Measured, instrument: InstrumentSection) -> Size:
    """Robust standard deviations of what a fit leaves; `NO_FIT` where it fails.

    ``nominal``: the nominal model; a free target is placed anew. ``measured``: the measured poses. ``instrument``: says
    what is free, and which noise is declared.
    """
    some = np.linspace(0, len(measured.T) - 1, min(len(measured.T), limits.ENOUGH_ROWS)).astype(int)
    measured, free = measured.take(some), instrument.frame == "free"
    if instrument.target == "free":
        nominal = replace(nominal, geometry=with_target(nominal.geometry, measured, free_frame=free)[0])
    poses = nominal.kinematics.forward(measured.q)
    there = poses.reached
    if there.sum() < limits.FEWEST_ROWS or there.mean() <= limits.REACHED:
        return NO_FIT
    measured, poses = measured.take(there), poses[there]
    start = replace(nominal, frame=rough_frame(poses, measured) if free else Frame())
    last = (instrument.position_sigma or limits.USUAL_NOISE[0], instrument.orientation_sigma or limits.USUAL_NOISE[1])
    readings, c = Readings.of_poses(measured.q, measured.T, measured.R, nominal.robot), measured.components
    x = None
    try:
        for sigmas in ((1e-3, 1e-3), last):  # with less at first, the cost is a narrow curved valley
            whitening = np.diag(1.0 / np.repeat(sigmas, 3)[:c])
            problem = Problem(start, readings, np.broadcast_to(whitening, (len(poses), c, c)), free)
            found = fit(problem, weights.huber, x, near=poses, enough=15)
            x, poses = found.point.x, found.point.poses
    except (ConvergenceError, np.linalg.LinAlgError):
        return NO_FIT
    off = np.abs(found.point.x[: found.problem.n_geometry])
    farthest = np.array([{"m": 0.02, "rad": 0.05}.get(p.unit, np.inf) for p in nominal.geometry.parameters])
    if ((off > limits.ANOTHER_TOLERANCES) & (off * nominal.geometry.tolerance > farthest)).any():
        return NO_FIT  # another robot
    residual = measured.residual_at(found.point.model.in_instrument_frame(poses))
    position, rotation = (float(np.median(np.linalg.norm(part, axis=1))) for part in (residual[:, :3], residual[:, 3:]))
    return position / MEDIAN, rotation / MEDIAN


def check_mixed_units(dataset: Dataset, poses: Poses) -> None:
    """Suspect positions that are in another unit in a part of the rows.

    ``poses``: (N) poses of the nominal model at the rows of the dataset, base frame; NaN where it can't reach.

    Raises `DatasetError` if there are such rows; it gives their number, and the lines of the first and the last in the
    file.
    """
    there = poses.reached
    found = _part(dataset.position[there], poses[there], dataset.instrument.frame == "free") if there.any() else None
    if found is None:
        return
    rows, unit, factor, before, after = found
    lines = dataset.row[there][rows]
    first, last, hint = int(lines.min()), int(lines.max()), f"multiply x, y and z of these rows by {factor:g}"
    what = f"x y z look like {unit} in {rows.sum()} of {len(dataset)} rows, the first in line {first} and the last in line "
    what += f"{last} of the file, and like metres in the others"
    error = DatasetError(what, file=dataset.file, row=first, column="x y z", hint=hint)
    suspect(error, dataset, (before, 0.0), (after, 0.0))


def _part(T: Floats, poses: Poses, free: bool) -> tuple[Mask, str, float, float, float] | None:
    """The rows in another unit, its name, its length in metres, and the rows' median errors, m, as metres and in it."""
    least = max(limits.FEWEST_ROWS, int(np.ceil(0.1 * len(T))))
    if len(T) < 2 * least:
        return None
    size = float(np.median(np.linalg.norm(poses.T - np.median(poses.T, axis=0), axis=1)))
    near = limits.ACCEPTED * size + limits.ALLOWED
    seen = _seen(T, poses, near) if free else poses.T
    off = _off(T, seen)
    fits = off[0] <= near
    tried = zip(UNITS, off[1:], strict=True)
    for (unit, factor), left in sorted(tried, key=lambda pair: -int((pair[1] <= near).sum())):
        rows = (left <= near) & (off[0] > limits.BETTER * left)
        if least <= rows.sum() <= len(T) - least and fits[~rows].mean() >= 0.75:
            return rows, unit, factor, float(np.median(off[0][rows])), float(np.median(left[rows]))
    return None


def _off(T: Floats, seen: Floats) -> Floats:
    """(1 + units, N) distances, m, of positions read in metres and in each other unit from where they should be."""
    return np.stack([np.linalg.norm(f * T - seen, axis=1) for f in (1.0, *(factor for _, factor in UNITS))])


def _seen(T: Floats, poses: Poses, near: float) -> Floats:
    """(N, 3) where a free instrument should see the poses, by the frame in which most rows fit in some unit."""
    some = np.linspace(0, len(T) - 1, min(len(T), 300)).astype(int)
    everywhere, T, poses = poses, T[some], poses[some]
    # Of 400 sets of three rows, every eighth is in metres alone where the two units have equal parts.
    rows = np.argsort(np.random.default_rng(0).random((400, len(T))), axis=1)[:, :3]
    a, b = poses.T[rows], T[rows]
    centre_a, centre_b = a.mean(axis=1), b.mean(axis=1)
    R = nearest(np.swapaxes(b - centre_b[:, None], 1, 2) @ (a - centre_a[:, None]))
    shift = centre_b - (R @ centre_a[..., None])[..., 0]
    tried = [_off(T, poses.T @ turn.T + moved) for turn, moved in zip(R, shift, strict=True)]
    off = max(tried, key=lambda off: (int((off.min(axis=0) <= near).sum()), -float(np.median(off.min(axis=0)))))
    good = off[0] <= near
    if good.sum() < limits.FEWEST_ROWS:  # no frame
        return np.full_like(everywhere.T, np.inf)
    # Three rows determine a frame roughly; all rows that fit in it determine it well.
    frame = rough_frame(poses[good], Measured(np.zeros((int(good.sum()), 0)), T[good], None))
    return np.asarray(everywhere.moved(frame.T, frame.R).T)
