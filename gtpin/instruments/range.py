"""Ranges: distances from stations to a target, as a ball bar, a draw wire or a laser tracer reads them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.data.instrument_tables import RangeTable
from gtpin.instruments.instrument import Component, RowError, Unknown
from gtpin.instruments.targets import AXES, OfTargets, Targets, indices, placed
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
        name, table = self.table.name, self.table
        centres = [
            Unknown(f"{name}.station[{station}].{axis}", "m", float(at[i]), table.station_sigma)
            for station, at in table.stations.items()
            for i, axis in enumerate(AXES)
        ]
        offsets = [Unknown(f"{name}.offset[{station}]", "m", 0.0, table.offset_sigma) for station in table.stations]
        return self._identified((*self.targets.unknowns, *centres, *offsets))

    def check(self) -> None:
        ranges = self.read.numbers["range"]
        bad = np.flatnonzero(~(ranges > 0.0))
        if len(bad):
            what = f"{ranges[bad[0]]:.6g} can't be"
            raise RowError(int(bad[0]), what, "range", "a range is a distance in m, above 0")

    def predicted(self, poses: Poses, u: Floats) -> Floats:
        ranges = np.linalg.norm(self.away(poses, u), axis=1)
        return np.asarray(ranges + self._split(u)[2][self.station])[:, None]

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, 1, 6) derivative by the TCP's pose: unit vector from station to target, times the motion of the target."""
        return self._sight(poses, u)[:, None] @ self.targets.by_pose(poses, self._split(u)[0])

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        """(M, 1, k) derivative by the targets and the stations' centres, along the line of sight, then by the offsets: 1."""
        sight, stations = self._sight(poses, u)[:, None], len(self.centre)
        of_targets = sight @ self.targets.by_unknown(poses)
        of_centres = placed(-sight, self.station, stations)
        offsets = placed(np.ones((len(poses), 1, 1)), self.station, stations)
        return np.concatenate([of_targets, of_centres, offsets], axis=2)[:, :, self._kept]

    def away(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3) from the station's centre to the target, base frame, m; u as for :meth:`predicted`."""
        of_targets, of_centres, _ = self._split(u)
        return self.targets.positions(poses, of_targets) - (self.centre + of_centres)[self.station]

    def _split(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Deviations of the targets, of the S stations' centres (S, 3), and of their offsets (S,)."""
        whole, a, b = self._whole(u), self.targets.count, self.targets.count + self.centre.size
        return whole[:a], whole[a:b].reshape(-1, 3), whole[b:]

    def _sight(self, poses: Poses, u: Floats) -> Floats:
        away = self.away(poses, u)
        return np.asarray(away / np.linalg.norm(away, axis=1)[:, None])
