"""Sockets: the target is at one point in all rows of one id, as a ball in a socket or a pin in a hole is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.data.instrument_tables import SocketTable
from gtpin.errors import DatasetError
from gtpin.instruments.instrument import Component, Unknown
from gtpin.instruments.targets import AXES, OfTargets, Targets, placed
from gtpin.kinematics.poses import Poses
from gtpin.typing import Floats, Indices, Mask

SHOWN = 10
"""Largest number of sockets that an error message lists."""


class Socket(OfTargets):
    """Position p of the target less the point s of its socket, base frame, m, which is 0; also known distances |s1 - s2|, m.

    A known distance between two sockets is assigned to K rows, each with the sigma of the distance times sqrt(K). Together they
    carry the information of one number. A fit without some of these rows still has most of this information.

    Unknown: each socket's point (prior: mean ``sockets``, standard deviation ``socket_sigma``; none where one of them is not
    given), and the targets (``target_sigma``).
    """

    kind, Table = "socket", SocketTable
    components = (
        *(Component(axis, "m", group=0) for axis in AXES),
        Component("distance", "m", group=1, shown=False),
    )
    table: SocketTable

    def _unknowns(self) -> Sequence[Unknown]:
        table = self.table
        self.targets = Targets(table, self.read)
        if "socket" not in self.read.ids:
            raise DatasetError("the column is missing", column="socket", hint="give each row the id of its socket")
        ids = self.read.ids["socket"].astype(str)
        self.names: list[str] = list(
            dict.fromkeys([*self.read.known["socket"], *(table.sockets if table.socket_sigma else ())])
        )
        place = {name: i for i, name in enumerate(self.names)}
        self.socket = np.array([place[name] for name in ids], dtype=np.intp)
        for distance in table.distances:
            for name in distance[:2]:
                if name not in place:
                    more = ", ..." if len(self.names) > SHOWN else ""
                    hint = f"sockets of the rows are {', '.join(self.names[:SHOWN])}{more}"
                    raise DatasetError(f"no row has the socket {name}", column="socket", hint=hint)
        declared = [table.sockets.get(name) for name in self.names]
        self._known = np.array([at is not None for at in declared])
        self.point = np.array([at or (0.0, 0.0, 0.0) for at in declared], dtype=float)
        self.link, self._shared = self._links()
        points = [
            Unknown(f"{table.name}.point[{name}].{axis}", "m", float(self.point[i, k]), self._sigma(i))
            for i, name in enumerate(self.names)
            for k, axis in enumerate(AXES)
        ]
        return self._identified((*self.targets.unknowns, *points))

    def _sigma(self, i: int) -> float:
        return self.table.socket_sigma if self._known[i] and self.table.socket_sigma else np.inf

    def _links(self) -> tuple[Indices, Floats]:
        """(M,) index in ``distances`` of that which is assigned to a row, -1 for none; (D,) number of rows of each distance."""
        distances = self.table.distances
        if "link" in self.read.numbers:  # `single` has assigned them, from all rows that were read
            link = np.nan_to_num(self.read.numbers["link"], nan=-1.0).astype(np.intp)
            own = (link >= 0) & np.isin(self.read.component, (-1, 3))
            return link, np.array([max(1.0, float((own & (link == i)).sum())) for i in range(len(distances))])
        link = np.full(self.read.count, -1, dtype=np.intp)
        for i, (one, two, *_) in enumerate(distances):
            rows = np.flatnonzero(np.isin(self.socket, [self.names.index(one), self.names.index(two)]) & (link < 0))
            if not len(rows):
                rows = np.flatnonzero(link < 0)
            if not len(rows):
                raise DatasetError("more known distances than rows", column="distances", hint="leave some out")
            left = sum(one in d[:2] or two in d[:2] for d in distances[i:])
            link[rows[:: max(left, 1)]] = i
        return link, np.array([float((link == i).sum()) for i in range(len(distances))])

    def read_components(self) -> Mask:
        """(M, 4) True for x, y and z in all rows, and for the distance in rows that have one."""
        own = np.ones((self.read.count, 4), dtype=bool)
        own[:, 3] = self.link >= 0
        return own

    @property
    def declared(self) -> tuple[float | None, ...]:
        """Declared sigma per axis, m; and 1, which is not used: :meth:`row_sigmas` gives those of distances."""
        return (self.table.sigma, 1.0)

    def row_sigmas(self) -> Floats | None:
        """(M, 4) sigmas of distances, m, in rows that have one; all else is NaN."""
        sigmas = np.full((self.read.count, 4), np.nan)
        rows = self.link >= 0
        if rows.any():
            sigma = np.array([distance[3] for distance in self.table.distances])
            sigmas[rows, 3] = (sigma * np.sqrt(self._shared))[self.link[rows]]
        return sigmas

    def counted(self) -> Floats:
        """(M, 4) 1, but 1 / K for a distance that is assigned to K rows."""
        counted = np.ones((self.read.count, 4))
        rows = self.link >= 0
        if rows.any():
            counted[rows, 3] = (1.0 / self._shared)[self.link[rows]]
        return counted

    def measured(self) -> Floats:
        """(M, 4) zeros for x, y and z, then the known distance (0 in rows without one), m."""
        values = np.zeros((self.read.count, 4))
        rows = self.link >= 0
        if rows.any():
            values[rows, 3] = np.array([distance[2] for distance in self.table.distances])[self.link[rows]]
        return values

    def predicted(self, poses: Poses, u: Floats) -> Floats:
        """(M, 4) target less its socket's point, base frame, and the distance between two sockets' points, m."""
        t, points = self._split(u)
        found = np.zeros((len(poses), 4))
        found[:, :3] = self.targets.positions(poses, t) - points[self.socket]
        for i, (one, two) in enumerate(self._pairs()):
            found[self.link == i, 3] = np.linalg.norm(points[one] - points[two])
        return found

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, 4, 6) derivative by the TCP's pose: motion of the target; 0 for the distance."""
        found = np.zeros((len(poses), 4, 6))
        found[:, :3] = self.targets.by_pose(poses, self._split(u)[0])
        return found

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        """(M, 4, k) derivative by the targets, then by the sockets' points."""
        _, points = self._split(u)
        k = self.targets.count
        found = np.zeros((len(poses), 4, k + self.point.size))
        found[:, :3, :k] = self.targets.by_unknown(poses)
        against = np.broadcast_to(-np.eye(3), (len(poses), 3, 3))
        found[:, :3, k:] = placed(against, self.socket, len(self.names))
        for i, (one, two) in enumerate(self._pairs()):
            apart = points[one] - points[two]
            unit = apart / np.linalg.norm(apart)
            rows = self.link == i
            found[rows, 3, k + 3 * one : k + 3 * one + 3] = unit
            found[rows, 3, k + 3 * two : k + 3 * two + 3] = -unit
        return found[:, :, self._kept]

    def start(self, nominal: Poses) -> Floats:
        """(k,) first guess: a socket without a prior is at the median of its nominal targets; all else as declared."""
        u, k = np.zeros(len(self._kept)), self.targets.count
        at = self.targets.positions(nominal, u[:k])
        for i in range(len(self.names)):
            rows = self.socket == i
            if not np.isfinite(self._sigma(i)) and rows.any():
                u[k + 3 * i : k + 3 * i + 3] = np.median(at[rows], axis=0) - self.point[i]
        return u[self._kept]

    def at(self, u: Floats, name: str) -> Floats:
        """(3,) position of the socket ``name``, base frame, m."""
        return np.asarray(self._split(u)[1][self.names.index(name)])

    def _pairs(self) -> list[tuple[int, int]]:
        return [(self.names.index(one), self.names.index(two)) for one, two, *_ in self.table.distances]

    def _split(self, u: Floats) -> tuple[Floats, Floats]:
        whole, k = self._whole(u), self.targets.count
        return whole[:k], self.point + whole[k:].reshape(-1, 3)
