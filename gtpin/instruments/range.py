"""Ranges: distances from stations to a target, as a ball bar, a draw wire or a laser tracer reads them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.data.instrument_tables import RangeTable
from gtpin.instruments.instrument import Component, RowError, Unknown
from gtpin.instruments.targets import AXES, OfTargets, Targets, indices
from gtpin.kinematics.poses import Poses
from gtpin.typing import Floats


class Range(OfTargets):
    """Distance from a station's centre s to the target p, plus the station's offset o: z = |p - s| + o, m.

    Unknown, in brackets the standard deviation of the prior: each station's centre (``station_sigma`` per axis) and offset
    (``offset_sigma``), and the targets (``target_sigma``).
    """

    kind, Table = "range", RangeTable
    components = (Component("range", "m"),)
    table: RangeTable

    def _unknowns(self) -> Sequence[Unknown]:
        self.targets = Targets(self.table, self.read)
        self.station = indices(self.read, "station", dict(self.table.stations), "station")
        self.centre = np.array(list(self.table.stations.values()), dtype=float)
        name, sigma = self.table.name, self.table.station_sigma
        centres = [
            Unknown(f"{name}.station[{station}].{axis}", "m", float(at[i]), sigma)
            for station, at in self.table.stations.items()
            for i, axis in enumerate(AXES)
            if sigma > 0.0
        ]
        self._n_centres = len(centres)
        offsets = [
            Unknown(f"{name}.offset[{station}]", "m", 0.0, self.table.offset_sigma)
            for station in self.table.stations
            if self.table.offset_sigma > 0.0
        ]
        return (*self.targets.unknowns, *centres, *offsets)

    def check(self) -> None:
        """Raise `DatasetError` for a range that is not positive."""
        ranges = self.read.numbers["range"]
        bad = np.flatnonzero(~(ranges > 0.0))
        if len(bad):
            what = f"{ranges[bad[0]]:.6g} can't be"
            raise RowError(int(bad[0]), what, "range", "a range is a distance in m, above 0")

    def predicted(self, poses: Poses, u: Floats) -> Floats:
        """(M, 1) predicted ranges, m; see :meth:`Instrument.predicted`."""
        offset = self._split(u)[2]
        ranges = np.linalg.norm(self.away(poses, u), axis=1)
        return np.asarray(ranges + offset[self.station] if len(offset) else ranges)[:, None]

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, 1, 6) derivative by the TCP's pose: unit vector from station to target, times the motion of the target."""
        return self._sight(poses, u)[:, None] @ self.targets.by_pose(poses, self._split(u)[0])

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        """(M, 1, k) derivative by the targets and the stations' centres, along the line of sight, then by the offsets: 1."""
        sight = self._sight(poses, u)
        of_targets = sight[:, None] @ self.targets.by_unknown(poses)
        of_centres = np.zeros((len(poses), 1, self._n_centres))
        stations = len(self.centre)
        for i in range(stations if self._n_centres else 0):
            rows = self.station == i
            of_centres[rows, 0, 3 * i : 3 * i + 3] = -sight[rows]
        offsets = np.zeros((len(poses), 1, len(u) - self.targets.count - self._n_centres))
        if offsets.shape[2]:
            offsets[np.arange(len(poses)), 0, self.station] = 1.0
        return np.concatenate([of_targets, of_centres, offsets], axis=2)

    def away(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3) from the station's centre to the target, base frame, m; u as for :meth:`predicted`."""
        of_target, of_centre, _ = self._split(u)
        centre = self.centre + (of_centre.reshape(-1, 3) if len(of_centre) else 0.0)
        return self.targets.positions(poses, of_target) - centre[self.station]

    def _split(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        a, b = self.targets.count, self.targets.count + self._n_centres
        return u[:a], u[a:b], u[b:]

    def _sight(self, poses: Poses, u: Floats) -> Floats:
        away = self.away(poses, u)
        return np.asarray(away / np.linalg.norm(away, axis=1)[:, None])
