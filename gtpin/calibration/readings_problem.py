"""The least-squares problem of a calibration by any instruments: the geometry, and the instruments' unknowns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import FARTHEST, FRAME_UNIT, Point
from gtpin.instruments.readings import VAGUE, Readings
from gtpin.kinematics.poses import Poses, chunks
from gtpin.model.model import Model
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class ReadingsProblem:
    """The fitted problem: x has the deviations of the geometry, in units of the tolerances, and of the instruments' unknowns.

    An unknown with a prior is measured from its declared value, in units of its sigma. An unknown without one is measured from
    the start of the fit, in mm or mrad, and gets a prior with the sigma ``VAGUE``: this has no influence where there are
    readings, and keeps the fit regular where all rows of a socket are set aside.

    Parameters
    ----------
    start
        Model at x = 0: nominal geometry.
    readings
        The readings, with the unknowns' values at x = 0.
    whitening
        (N, c, c) whitening matrices: see :class:`~gtpin.noise.reading_noise.ReadingNoise`.
    """

    start: Model
    readings: Readings
    whitening: Floats

    @property
    def n_geometry(self) -> int:
        """Number of geometric parameters."""
        return len(self.start.geometry.parameters)

    @property
    def size(self) -> int:
        """Length of x."""
        return self.n_geometry + len(self.readings.u)

    @property
    def prior(self) -> Floats:
        """(size,) weight of the square of each x in the cost: 1, but nearly 0 for an unknown without a prior."""
        vague = (FRAME_UNIT / VAGUE) ** 2
        return np.concatenate([np.ones(self.n_geometry), np.where(np.isfinite(self.readings.sigma), 1.0, vague)])

    @property
    def unit(self) -> Floats:
        """(k,) size of one unit of x for each unknown, m or rad."""
        sigma = self.readings.sigma
        return np.where(np.isfinite(sigma), sigma, FRAME_UNIT)

    def unknowns(self, x: Floats) -> Floats:
        """(k,) deviations of the unknowns from their declared values."""
        base = np.where(np.isfinite(self.readings.sigma), 0.0, self.readings.u)
        return np.asarray(base + self.unit * x[self.n_geometry : self.size])

    @property
    def first(self) -> Floats:
        """(size,) x at nominal geometry and at the values of the unknowns that ``readings`` has."""
        of_unknowns = np.where(np.isfinite(self.readings.sigma), self.readings.u / self.unit, 0.0)
        return np.concatenate([np.zeros(self.n_geometry), of_unknowns])

    def point(self, x: Floats, near: Poses | None = None) -> Point:
        """The model at x, and its poses, base frame; NaN where a pose can't be reached."""
        geometry = self.start.geometry
        moved = geometry.with_values(geometry.values + geometry.tolerance * x[: self.n_geometry])
        model = replace(self.start, geometry=moved)
        return Point(x, model, model.kinematics.forward(self.readings.q, near))

    def residual(self, point: Point) -> Floats:
        """(N, c) whitened measured less predicted."""
        return self.residual_at(point, point.poses)

    def residual_at(self, point: Point, poses: Poses) -> Floats:
        """(N, c) whitened measured less predicted, for given poses, base frame, instead of those of the point's geometry."""
        return self.whiten(self.readings.at(self.unknowns(point.x)).minus(poses))

    def whiten(self, values: Floats) -> Floats:
        """(N, c) values in units of the noise."""
        return np.asarray(np.clip(np.einsum("nij,nj->ni", self.whitening, values), -FARTHEST, FARTHEST))

    @property
    def measured(self) -> Readings:
        """The readings."""
        return self.readings

    @property
    def count(self) -> float:
        """Number of independent measured numbers."""
        return float(self.readings.counted.sum())

    def take(self, rows: npt.NDArray[np.generic], whitening: Floats) -> ReadingsProblem:
        """The problem of some of the rows, with their whitening matrices."""
        return replace(self, readings=self.readings.take(rows), whitening=whitening)

    def whitened(self, whitening: Floats) -> ReadingsProblem:
        """The same problem with other whitening matrices."""
        return replace(self, whitening=whitening)

    def noisier(self, factor: float) -> ReadingsProblem:
        """The same problem with the noise multiplied by a factor."""
        return replace(self, whitening=self.whitening / factor)

    def left(self, point: Point, poses: Poses) -> Floats:
        """(N, c) measured less predicted at ``poses`` (base frame), m and rad, with the unknowns at the point."""
        return self.readings.at(self.unknowns(point.x)).minus(poses)

    def chunks(self) -> list[slice]:
        """Slices of rows that fit in memory with their derivatives."""
        return chunks(len(self.whitening))

    def at_commands(self, q: Floats) -> ReadingsProblem:
        """The same problem with its derivatives at other commands q (N, n), m or rad."""
        return replace(self, readings=replace(self.readings, q=q))

    def jacobian(self, point: Point, rows: slice, weight: Floats | None = None) -> Floats:
        """(M, c, size) derivative of the whitened prediction by x, for some rows, times the roots of their weights (M,)."""
        model, poses = point.model, point.poses[rows]
        readings = self.readings.take(rows).at(self.unknowns(point.x))
        J = model.kinematics.geometry_jacobian(readings.q, poses) * model.geometry.tolerance
        seen = np.concatenate([readings.by_motion(poses) @ J, readings.by_unknown(poses) * self.unit], axis=2)
        return self._whitened(seen, rows, weight)

    def columns(self, point: Point, moved: Floats, rows: slice, weight: Floats | None = None) -> Floats:
        """(M, c, m) motions (M, 6 + k, m) of some rows' poses, base frame, as whitened readings."""
        readings = self.readings.take(rows).at(self.unknowns(point.x))
        return self._whitened(readings.by_motion(point.poses[rows]) @ moved, rows, weight)

    def _whitened(self, seen: Floats, rows: slice, weight: Floats | None) -> Floats:
        root = 1.0 if weight is None else np.sqrt(weight)[:, None, None]
        return np.asarray(self.whitening[rows] @ seen * root)
