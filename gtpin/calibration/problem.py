"""The least-squares problem of a calibration: whitened residuals of all readings and their derivatives, in chunks; and first
guesses of what is free, by fits of nominal and measured poses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.data import Dataset
from gtpin.data.files import warn_of
from gtpin.data.plausible import sane_rows
from gtpin.errors import DatasetError
from gtpin.instruments.frame_and_target import Placement, aligned, alignment, frame_and_target
from gtpin.instruments.readings import VAGUE, Readings
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.poses import Poses, chunks
from gtpin.kinematics.rotations import exp, frame_motions, from_quaternions, left_jacobian
from gtpin.model.model import Frame, Model
from gtpin.robot.command_ranges import check_actuators
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Indices

CLIPPED = 1e12
"""Largest whitened residual; larger ones are clipped, so that the square of a gross error is finite."""
POSITIONS = 1e-2
"""Error of positions, m, that counts as much as 1 rad of orientation where positions are reported: orientations decide only
what positions leave open, as a rotation about a line of them. Assumed."""
FRAME_UNIT = 1e-3
"""Unit, m and rad, of unknowns without a prior in the fit's x: about a tolerance, so that all unknowns have one scale."""


@dataclass(frozen=True)
class Measured:
    """N measured poses as they stand in a table: q (N, n), m or rad; T (N, 3), m, R (N, 3, 3) or None, instrument's frame."""

    q: Floats
    T: Floats
    R: Floats | None

    @property
    def components(self) -> int:
        """Number c of measured components of a pose: 3 or 6."""
        return 3 if self.R is None else 6

    def take(self, rows: npt.NDArray[np.generic] | slice) -> Measured:
        """The poses that a mask, indices or a slice select."""
        return Measured(self.q[rows], self.T[rows], None if self.R is None else self.R[rows])

    def residual_at(self, predicted: Poses) -> Floats:
        """(N, c) measured less predicted: position, m, and rotation vector, rad, instrument's frame."""
        if self.R is None:
            return self.T - predicted.T
        return Poses(self.T, self.R).minus(predicted)


@dataclass(frozen=True)
class Point:
    """An iterate x of the fit: its model, and its poses in the base frame at the measured commands."""

    x: Floats
    model: Model
    poses: Poses


@dataclass(frozen=True, eq=False)
class Problem:
    """The fitted problem: x has the deviations of the geometry, in units of the tolerances, the instruments' unknowns, and the
    pose of a free frame of the instrument.

    An unknown with a prior is measured from its declared value, in units of its sigma. An unknown without one is measured from
    the start of the fit, in mm or mrad, and gets a prior with the sigma ``VAGUE``: this has no influence where there are
    readings, and keeps the fit regular where all rows of a socket are set aside. So does the pose of a free frame, which can
    turn about a line of positions.

    - ``start``: model at x = 0: nominal geometry, and a first guess of the instrument's frame.
    - ``measured``: the readings, with the unknowns' values at x = 0.
    - ``whitening``: (N, c, c) whitening matrices: see :class:`~gtpin.noise.reading_noise.ReadingNoise`.
    - ``free_frame``: whether the frame of the instrument is identified too.
    """

    start: Model
    measured: Readings
    whitening: Floats
    free_frame: bool = False

    @property
    def n_geometry(self) -> int:
        """Number of geometric parameters."""
        return len(self.start.geometry.parameters)

    @property
    def _n_known(self) -> int:
        """Number of unknowns before those of a free frame."""
        return self.n_geometry + len(self.measured.u)

    @property
    def size(self) -> int:
        """Length of x."""
        return self._n_known + 6 * self.free_frame

    @property
    def prior(self) -> Floats:
        """(size,) weight of the square of each x in the cost: 1; nearly 0 for an unknown without a prior."""
        vague = (FRAME_UNIT / VAGUE) ** 2
        of_unknowns = np.where(np.isfinite(self.measured.sigma), 1.0, vague)
        return np.concatenate([np.ones(self.n_geometry), of_unknowns, np.full(6 * self.free_frame, vague)])

    @property
    def unit(self) -> Floats:
        """(k,) size of one unit of x for each unknown of the instruments, m or rad."""
        sigma = self.measured.sigma
        return np.where(np.isfinite(sigma), sigma, FRAME_UNIT)

    def readings(self, x: Floats) -> Readings:
        """The readings with the instruments' unknowns at x."""
        if not len(self.measured.u):
            return self.measured
        base = np.where(np.isfinite(self.measured.sigma), 0.0, self.measured.u)
        return self.measured.at(base + self.unit * x[self.n_geometry : self._n_known])

    @property
    def first(self) -> Floats:
        """(size,) x at nominal geometry and at the values of the unknowns that ``measured`` has."""
        of_unknowns = np.where(np.isfinite(self.measured.sigma), self.measured.u / self.unit, 0.0)
        return np.concatenate([np.zeros(self.n_geometry), of_unknowns, np.zeros(6 * self.free_frame)])

    def point(self, x: Floats, near: Poses | None = None) -> Point:
        """The model at x, and its poses, base frame; NaN where a pose can't be reached."""
        geometry = self.start.geometry
        moved = geometry.with_values(geometry.values + geometry.tolerance * x[: self.n_geometry])
        model = replace(self.start, geometry=moved, frame=self._frame(x))
        return Point(x, model, model.kinematics.forward(self.measured.q, near))

    def residual(self, point: Point) -> Floats:
        """(N, c) whitened measured less predicted."""
        return self.residual_at(point, point.poses)

    def residual_at(self, point: Point, poses: Poses) -> Floats:
        """(N, c) whitened measured less predicted, for given poses, base frame, instead of those of the point's geometry."""
        whitened = np.einsum("nij,nj->ni", self.whitening, self.raw_residual(point, poses))
        return np.asarray(np.clip(whitened, -CLIPPED, CLIPPED))

    def raw_residual(self, point: Point, poses: Poses) -> Floats:
        """(N, c) measured less predicted at ``poses`` (base frame), m and rad, with frame and unknowns at the point."""
        return self.readings(point.x).residual(point.model, poses)

    @property
    def count(self) -> float:
        """Number of independent measured numbers."""
        return float(self.measured.counted.sum())

    def take(self, rows: npt.NDArray[np.generic], whitening: Floats) -> Problem:
        """The problem of some of the rows, with their whitening matrices."""
        return replace(self, measured=self.measured.take(rows), whitening=whitening)

    def noisier(self, factor: float) -> Problem:
        """The same problem with the noise multiplied by a factor."""
        if self.whitening.strides[0] == 0:  # one matrix for all rows
            return replace(self, whitening=np.broadcast_to(self.whitening[0] / factor, self.whitening.shape))
        return replace(self, whitening=self.whitening / factor)

    def at_commands(self, q: Floats) -> Problem:
        """The same problem with its derivatives at other commands q (N, n), m or rad."""
        return replace(self, measured=replace(self.measured, q=q))

    def chunks(self) -> list[slice]:
        """Slices of rows that fit in memory with their derivatives."""
        return chunks(len(self.whitening))

    def jacobian(self, point: Point, rows: slice | Indices, weight: Floats | None = None) -> Floats:
        """(M, c, size) derivative of the whitened prediction by x, for some rows, times the roots of their weights (M,)."""
        model, poses = point.model, point.poses[rows]
        measured = self.readings(point.x).take(rows)
        J = model.kinematics.geometry_jacobian(measured.q, poses)
        J *= model.geometry.tolerance
        parts = [measured.change_by(J, model, poses)]
        if len(measured.u):
            parts.append(measured.by_unknown(model.in_instrument_frame(poses)) * self.unit)
        if self.free_frame:
            shift, vector = self._frame_change(point.x)
            motion = frame_motions(model.in_instrument_frame(poses).T - self.pivot - shift)
            motion[:, :, 3:] = motion[:, :, 3:] @ left_jacobian(vector)
            parts.append(FRAME_UNIT * measured.by_motion(model.in_instrument_frame(poses)) @ motion)
        return self._whitened(np.concatenate(parts, axis=2) if len(parts) > 1 else parts[0], rows, weight)

    def columns(self, point: Point, moved: Floats, rows: slice | Indices, weight: Floats | None = None) -> Floats:
        """(M, c, m) motions (M, 6 + j, m) of some rows' poses, base frame, and of measured joints, as whitened readings."""
        measured = self.readings(point.x).take(rows)
        return self._whitened(measured.change_by(moved, point.model, point.poses[rows]), rows, weight)

    def by_command(self, point: Point, rows: slice | Indices) -> Floats:
        """(M, c, n) derivative of the readings of some rows by the commands, m and rad."""
        model, poses, measured = point.model, point.poses[rows], self.readings(point.x).take(rows)
        return measured.change_by(model.kinematics.command_jacobian(measured.q, poses), model, poses)

    def _whitened(self, seen: Floats, rows: slice | Indices, weight: Floats | None) -> Floats:
        whitening = self.whitening[rows] if weight is None else self.whitening[rows] * np.sqrt(weight)[:, None, None]
        return np.asarray(whitening @ seen)

    @property
    def poses(self) -> Measured:
        """The measured poses of a single tracker."""
        T, R = self.measured.poses
        return Measured(self.measured.q, T, R)

    def _frame_change(self, x: Floats) -> tuple[Floats, Floats]:
        """Shift (3,), m, and rotation vector (3,), rad, of the base frame in the instrument's frame, relative to the start."""
        n = self._n_known  # x may have more numbers, which belong to a larger problem
        return FRAME_UNIT * x[n : n + 3], FRAME_UNIT * x[n + 3 : n + 6]

    @cached_property
    def pivot(self) -> Floats:
        """(3,) centre of this rotation: the middle of a tracker's poses, about which shift and rotation are nearly
        independent."""
        return np.asarray(np.median(self.measured.poses[0], axis=0))

    def _frame(self, x: Floats) -> Frame:
        if not self.free_frame:
            return self.start.frame
        shift, vector = self._frame_change(x)
        turn, old = exp(vector), self.start.frame
        return Frame(self.pivot + shift + turn @ (old.T - self.pivot), turn @ old.R)


def measured_poses(dataset: Dataset) -> Measured:
    """A dataset's poses, with rotations as matrices."""
    R = None if dataset.orientation is None else from_quaternions(dataset.orientation)
    return Measured(dataset.q, dataset.position, R)


def rough_frame(predicted: Poses, measured: Measured) -> Frame:
    """First guess of the base frame's pose in the instrument's frame, by ``alignment``."""
    return Frame(*alignment(predicted, measured.T, measured.R))


def problem_of(dataset: Dataset, near: Poses, nominal: Model, *, free: bool) -> Problem:
    """The problem about the nominal machine, with the frame, and the instruments' unknowns, that fit it best.

    ``near``: (N) poses of ``nominal`` at the dataset's rows, base frame. ``free``: whether a single tracker stands elsewhere.

    Raises `DatasetError` if there are fewer measured numbers than unknowns without a prior.
    """
    readings = Readings.of(dataset, nominal.robot)
    readings, c = readings.at(readings.start(near)), readings.components
    numbers, unknowns = len(dataset) * c, readings.free_unknowns(free)
    if numbers <= unknowns:
        what = f"{numbers} readings for {unknowns} unknowns of the instruments alone"
        raise DatasetError(what, file=dataset.file, hint="measure more")
    start = replace(nominal, frame=rough_frame(near, measured_poses(dataset)) if free else Frame())
    whitening = np.broadcast_to(np.eye(c), (len(dataset), c, c))
    return Problem(start, with_unknowns(readings, near), whitening, free)


def nominal_residual(problem: Problem, near: Poses) -> Floats:
    """(N, c) measured less predicted by the nominal geometry, m and rad, with a free frame and the instruments' unknowns fitted
    to it: they minimise the errors that are reported, of a tracker those of positions.

    ``near``: (N) poses of the geometry at the start of the fit, base frame: the nominal one, except for what is held elsewhere.
    """
    readings, start = problem.measured, problem.start
    if not start.geometry.is_nominal:
        nominal = replace(start.geometry, held=tuple((p, p.nominal) for p, _ in start.geometry.held))
        poses = Model(nominal).kinematics.forward(readings.q)
        if poses.reached.all():
            start, near = replace(start, geometry=nominal), poses
    if problem.free_frame:
        measured = problem.poses
        start = replace(start, frame=Frame(*aligned(near, measured.T, measured.R, np.ones(len(near)), POSITIONS)))
    return with_unknowns(readings, near, reported=True).residual(start, near)


def with_unknowns(readings: Readings, poses: Poses, *, reported: bool = False) -> Readings:
    """The readings with the unknowns' values that fit best at given poses (N), base frame; gross errors have little weight.

    ``reported``: whether to minimise the squares of the errors that are reported of each instrument, in place of those of all
    numbers; then there are no gross errors.
    """
    if not len(readings.u):
        return readings
    sigma = readings.sigma
    unit, prior = np.where(np.isfinite(sigma), sigma, FRAME_UNIT), np.isfinite(sigma).astype(float)
    each = np.where(np.isfinite(readings.row_sigma), readings.row_sigma, readings.initial_sigma[readings.group])
    # The nominal geometry has errors of the size of its tolerances, about 1 mm and 1 mrad. With the instruments' noise alone,
    # the unknowns would compensate these errors.
    each = np.hypot(each, 1e-3)
    if reported:
        each = np.where(readings.shown, each, each / POSITIONS)
    start = readings.u
    for _ in range(12):
        residual = readings.residual_at(poses) / each
        weight = 1.0 / np.maximum(np.abs(residual) / max(float(np.median(np.abs(residual))), 1e-9) / 3.0, 1.0)
        weight = np.ones_like(weight) if reported else weight
        J = (readings.by_unknown(poses) * unit / each[:, :, None] * np.sqrt(weight)[:, :, None]).reshape(-1, len(unit))
        x = np.where(np.isfinite(sigma), readings.u / unit, 0.0)
        normal = J.T @ J + np.diag(prior) + 1e-12 * np.eye(len(unit))
        step = np.linalg.solve(normal, J.T @ (residual * np.sqrt(weight)).ravel() - prior * x)
        now = readings.u + unit * step
        far = ~(np.abs(now - start) <= 1e3)  # readings that need more are not a robot's, and are compared at this limit
        readings = readings.at(np.where(far, readings.u, now))
        if np.abs(step).max() < 1e-6:
            break
    return readings


def with_free_target(geometry: Geometry, dataset: Dataset) -> Geometry:
    """The geometry with the TCP moved to a first guess of the target and with wide tolerances, if the dataset's target is free.

    Raises `DatasetError` where the TCP's place is no parameter, as of a robot with rods, or for another number of actuators.
    Warns: says what the poses can't determine, and what is assumed.
    """
    if dataset.instrument.target != "free":
        return geometry
    if sum(p.kind == "platform" for p in geometry.parameters) < 6:
        what = "a free target, but the TCP's place is no parameter"
        hint = "hold no part of its place"
        if geometry.robot.rod_sites:
            hint = (
                "measure where the target sits, m, TCP frame, and write target = [x, y, z] under [instrument]: of a robot with "
                "rods it can't be identified"
            )
        raise DatasetError(what, file=dataset.toml or dataset.file, column="instrument.target", hint=hint)
    check_actuators(geometry.robot, dataset)
    measured = measured_poses(dataset.take(sane_rows(dataset)))
    free = dataset.instrument.frame == "free"
    found, place = with_target(geometry, measured, free_frame=free)
    if place is not None and (text := unseen_words(place.unseen)):
        warn_of(dataset.file, text)
    return found


def with_target(geometry: Geometry, measured: Measured, *, free_frame: bool) -> tuple[Geometry, Placement | None]:
    """The geometry with the TCP at a first guess of the target, and the guess; unchanged where no pose can be reached."""
    poses = Kinematics(without_target(geometry)).forward(measured.q)
    good = poses.reached
    if not good.any():
        return geometry, None
    seen = measured.take(good)
    place = frame_and_target(poses[good], seen.T, seen.R, free_frame=free_frame)
    guess = pin.log6(pin.SE3(place.mount, place.at)).vector
    values, parameters = geometry.values.copy(), []
    for i, p in enumerate(geometry.parameters):
        if p.kind == "platform":
            # At least 50 mm and 0.1 rad: the error of the guess is that of the robot, where the poses determine the target.
            values[i] = guess[p.component]
            # A target without orientations is a point: its axes are the TCP's. Any rotation would only couple with its place.
            at, turn = (0.05, p.tolerance) if seen.R is None else (place.at_sigma, max(0.1, place.mount_sigma))
            own = max(0.05, at) if p.component < 3 else turn
            p = replace(p, nominal=float(values[i]), tolerance=own)
        parameters.append(p)
    return replace(geometry, parameters=tuple(parameters), values=values), place


def unseen_words(unseen: Floats) -> str:
    """What poses do not determine of a target's place, as a sentence; empty where they determine all of it.

    ``unseen``: (k, 3) unit vectors, TCP frame.
    """
    fixed = "it is left where the TCP is, and the instrument's frame takes up the difference"
    if len(unseen) == 3:
        return f"these poses do not determine where the target sits on the platform, for the robot does not turn it: {fixed}"
    named = " and ".join(f"({', '.join(f'{v + 0.0:.3g}' for v in np.round(axis, 3))})" for axis in unseen)
    if not named:
        return ""
    return f"these poses do not determine where the target sits along {named} of the TCP's frame: along this, {fixed}"


def without_target(geometry: Geometry) -> Geometry:
    """The geometry with the TCP where the robot's description has it, and its place no parameter."""
    kept = [i for i, p in enumerate(geometry.parameters) if p.kind != "platform"]
    return replace(geometry, parameters=tuple(geometry.parameters[i] for i in kept), values=geometry.values[kept])
