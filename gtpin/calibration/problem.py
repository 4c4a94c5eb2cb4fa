"""The least-squares problem of a calibration: whitened pose residuals and their derivatives, in chunks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset
from gtpin.kinematics.frame_and_target import alignment
from gtpin.kinematics.poses import Poses, chunks
from gtpin.kinematics.rotations import exp, frame_motions, from_quaternions, left_jacobian
from gtpin.model.model import Frame, Model
from gtpin.typing import Floats

FARTHEST = 1e12
"""Largest whitened residual; larger ones are clipped, so that the square of a gross error is finite."""
USUAL = (2e-5, 5e-5)
"""Usual noise of a tracker, m and rad: undeclared sigmas start here; only their ratio matters until they are estimated."""
FRAME_UNIT = 1e-3
"""Unit, m and rad, of the instrument's pose in the fit's unknowns x: about a tolerance, so that all unknowns have one scale."""


@dataclass(frozen=True)
class Measured:
    """N measured poses: commands q (N, n), m or rad; T (N, 3), m, and R (N, 3, 3) or None, in the instrument's frame.

    ``sigmas``: the declared noise of a position, m, and of an orientation, rad, per axis; None where it is to be estimated.
    ``station``: where the instrument stands, in its frame, m; None where that is not known.
    """

    q: Floats
    T: Floats
    R: Floats | None
    sigmas: tuple[float | None, float | None] = (None, None)
    station: tuple[float, float, float] | None = None

    @property
    def components(self) -> int:
        """Number c of measured components of a pose: 3 or 6."""
        return 3 if self.R is None else 6

    def take(self, rows: npt.NDArray[np.generic] | slice) -> Measured:
        """The poses that a mask, indices or a slice select."""
        if isinstance(rows, np.ndarray) and rows.dtype == bool and rows.all():
            return self
        return replace(self, q=self.q[rows], T=self.T[rows], R=None if self.R is None else self.R[rows])

    @property
    def declared(self) -> tuple[float | None, ...]:
        """The declared sigma of each group of numbers: of positions, and of orientations where they are measured."""
        return self.sigmas[: self.components // 3]

    @property
    def usual(self) -> Floats:
        """(G,) declared sigmas, m and rad, or a tracker's usual ones, at which their estimation starts."""
        return np.array([sigma or usual for sigma, usual in zip(self.declared, USUAL, strict=False)])

    @property
    def group(self) -> npt.NDArray[np.intp]:
        """(N, c) index of each number's sigma."""
        return np.broadcast_to(np.array([0, 0, 0, 1, 1, 1])[: self.components], (len(self.T), self.components))

    @property
    def row_sigma(self) -> Floats:
        """(N, c) NaN: no row declares its own sigma."""
        return np.broadcast_to(np.full(self.components, np.nan), (len(self.T), self.components))

    @property
    def counted(self) -> Floats:
        """(N, c) degrees of freedom that each number counts as: 1."""
        return np.broadcast_to(np.ones(self.components), (len(self.T), self.components))

    @property
    def alike(self) -> list[npt.NDArray[np.intp]]:
        """Groups of rows whose residuals are compared with each other: all rows."""
        return [np.arange(len(self.T))]

    @property
    def read(self) -> npt.NDArray[np.intp]:
        """(N,) what a row reads at its commands: the same in all rows."""
        return np.zeros(len(self.T), dtype=np.intp)

    def left(self, model: Model, poses: Poses) -> Floats:
        """(N, c) measured less ``poses`` (base frame) as the model's instrument reads them; m and rad, instrument's frame."""
        return self.minus(model.seen(poses))

    def scatter(self, J: Floats, model: Model, _: Poses) -> Floats:
        """(N, 6, n) derivative of the poses by the commands, J (N, 6, n) in the base frame, in the instrument's frame."""
        return in_frame(J, model.frame)

    def seen(self, J: Floats, model: Model, _: Poses) -> Floats:
        """(N, c, m) motions J (N, 6, m) of the poses, base frame, as changes of the c measured components."""
        return in_frame(J, model.frame)[:, : self.components]

    def unknown_columns(self, model: Model, poses: Poses, free_frame: bool, pivot: Floats | None) -> tuple[Floats, int]:
        """(N, c, k) derivatives of the measurements by the instrument's unknowns, and how many of these have no prior.

        They are the six of a free frame: shifts, m, and rotations, rad, about ``pivot`` (3,); None: the middle of the poses.
        """
        if not free_frame:
            return np.zeros((len(self.T), self.components, 0)), 0
        T = model.seen(poses).T
        return frame_motions(T - (T.mean(axis=0) if pivot is None else pivot))[:, : self.components], 6

    def at_trials(self, _: npt.NDArray[np.intp], q: Floats, seen: Poses) -> Measured:
        """Poses at commands q that would be measured as these: ``seen`` are all of them, instrument's frame."""
        R = None if self.R is None else np.concatenate([self.R, seen.R])
        return replace(self, q=q, T=np.vstack([self.T, seen.T]), R=R)

    @property
    def deviation(self) -> Floats:
        """(0,) empty: a tracker's poses have no unknowns with a prior."""
        return np.zeros(0)

    def taken(self, free_frame: bool) -> int:
        """Number of unknowns without a prior, which is the number of degrees of freedom that they take."""
        return 6 if free_frame else 0

    def minus(self, predicted: Poses) -> Floats:
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


@dataclass(frozen=True)
class Problem:
    """The fitted problem: x has the deviations of the geometry, in units of the tolerances, and the pose of a free instrument.

    Parameters
    ----------
    start
        Model at x = 0: nominal geometry, and a first guess of the instrument's pose.
    measured
        The measured poses.
    whitening
        (N, c, c) whitening matrices: see :class:`~gtpin.noise.noise.Noise`.
    free_frame
        Whether the instrument's pose is identified too.
    """

    start: Model
    measured: Measured
    whitening: Floats
    free_frame: bool

    @property
    def n_geometry(self) -> int:
        """Number of geometric parameters."""
        return len(self.start.geometry.parameters)

    @property
    def size(self) -> int:
        """Length of x."""
        return self.n_geometry + (6 if self.free_frame else 0)

    @property
    def prior(self) -> Floats:
        """(size,) weight of the square of each x in the cost: 1 for a geometric parameter, 0 for the instrument's pose."""
        return np.concatenate([np.ones(self.n_geometry), np.zeros(self.size - self.n_geometry)])

    def point(self, x: Floats, near: Poses | None = None) -> Point:
        """The model at x, and its poses; NaN where a pose can't be reached."""
        geometry = self.start.geometry
        moved = geometry.with_values(geometry.values + geometry.tolerance * x[: self.n_geometry])
        model = replace(self.start, geometry=moved, frame=self._frame(x))
        return Point(x, model, model.kinematics.forward(self.measured.q, near))

    @property
    def first(self) -> Floats:
        """(size,) x of the start."""
        return np.zeros(self.size)

    def residual(self, point: Point) -> Floats:
        """(N, c) whitened measured less predicted."""
        return self.residual_at(point, point.poses)

    def residual_at(self, point: Point, poses: Poses) -> Floats:
        """(N, c) whitened measured less ``poses`` (base frame), with the instrument's pose at the point."""
        return self.whiten(self.measured.minus(point.model.seen(poses)))

    def columns(self, point: Point, moved: Floats, rows: slice, weight: Floats | None = None) -> Floats:
        """(M, c, m) motions (M, 6, m) of some rows' poses, base frame, in units of the noise."""
        return self.whitened_columns(in_frame(moved, point.model.frame), rows, weight)

    def whiten(self, values: Floats) -> Floats:
        """(N, c) values in units of the noise."""
        return np.asarray(np.clip(np.einsum("nij,nj->ni", self.whitening, values), -FARTHEST, FARTHEST))

    def noisier(self, factor: float) -> Problem:
        """The same problem with the noise multiplied by a factor."""
        if self.whitening.strides[0] == 0:  # one matrix for all poses
            return replace(self, whitening=np.broadcast_to(self.whitening[0] / factor, self.whitening.shape))
        return replace(self, whitening=self.whitening / factor)

    @property
    def count(self) -> float:
        """Number of independent measured numbers."""
        return float(len(self.measured.T) * self.measured.components)

    def take(self, rows: npt.NDArray[np.generic], whitening: Floats) -> Problem:
        """The problem of some of the rows, with their whitening matrices."""
        return replace(self, measured=self.measured.take(rows), whitening=whitening)

    def whitened(self, whitening: Floats) -> Problem:
        """The same problem with other whitening matrices."""
        return replace(self, whitening=whitening)

    def left(self, point: Point, poses: Poses) -> Floats:
        """(N, c) measured less ``poses`` (base frame), m and rad, with the instrument's pose at the point."""
        return self.measured.left(point.model, poses)

    def at_commands(self, q: Floats) -> Problem:
        """The same problem with its derivatives at other commands q (N, n), m or rad."""
        return replace(self, measured=replace(self.measured, q=q))

    def chunks(self) -> list[slice]:
        """Slices of rows that fit in memory with their derivatives."""
        return chunks(len(self.measured.T))

    def jacobian(self, point: Point, rows: slice, weight: Floats | None = None) -> Floats:
        """(M, c, size) derivative of the whitened prediction by x, for some rows, times the roots of their weights (M,)."""
        model, poses = point.model, point.poses[rows]
        J = model.kinematics.geometry_jacobian(self.measured.q[rows], poses)
        J *= model.geometry.tolerance
        J = in_frame(J, model.frame)
        if self.free_frame:
            shift, vector = self._frame_change(point.x)
            motion = frame_motions(model.seen(poses).T - self._pivot - shift)
            motion[:, :, 3:] = motion[:, :, 3:] @ left_jacobian(vector)
            J = np.concatenate([J, FRAME_UNIT * motion], axis=2)
        return self.whitened_columns(J, rows, weight)

    def whitened_columns(self, J: Floats, rows: slice, weight: Floats | None = None) -> Floats:
        """(M, c, m) derivatives J (M, 6, m) of some rows' poses in units of the noise, times the roots of weights (M,)."""
        whitening = self.whitening[rows] if weight is None else self.whitening[rows] * np.sqrt(weight)[:, None, None]
        return np.asarray(whitening @ J[:, : self.measured.components])

    def _frame_change(self, x: Floats) -> tuple[Floats, Floats]:
        """Shift (3,), m, and rotation vector (3,), rad, of the base frame in the instrument's frame, relative to the start."""
        n = self.n_geometry  # x may have more numbers, which belong to a larger problem
        return FRAME_UNIT * x[n : n + 3], FRAME_UNIT * x[n + 3 : n + 6]

    @cached_property
    def _pivot(self) -> Floats:
        """(3,) centre of this rotation: the middle of the poses, about which shift and rotation are nearly independent."""
        return np.asarray(np.median(self.measured.T, axis=0))

    def _frame(self, x: Floats) -> Frame:
        if not self.free_frame:
            return self.start.frame
        shift, vector = self._frame_change(x)
        turn, old = exp(vector), self.start.frame
        return Frame(self._pivot + shift + turn @ (old.T - self._pivot), turn @ old.R)


def measured_poses(dataset: Dataset) -> Measured:
    """A dataset's poses, with rotations as matrices."""
    R = None if dataset.orientation is None else from_quaternions(dataset.orientation)
    instrument = dataset.instrument
    sigmas = (instrument.position_sigma, instrument.orientation_sigma)
    return Measured(dataset.q, dataset.position, R, sigmas, instrument.station)


def in_frame(J: Floats, frame: Frame) -> Floats:
    """Derivatives (N, 6, p) of poses in the base frame, transformed to the instrument's frame."""
    if frame.is_base:
        return J
    seen = np.empty_like(J)
    seen[:, :3], seen[:, 3:] = frame.R @ J[:, :3], frame.R @ J[:, 3:]
    return seen


def rough_frame(predicted: Poses, measured: Measured) -> Frame:
    """First guess of the base frame's pose in the instrument's frame, by ``alignment``."""
    return Frame(*alignment(predicted, measured.T, measured.R))
