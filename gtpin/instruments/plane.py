"""Touches: the height of a target over a plane, as a probe, a bed mesh or a dial gauge reads it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.data.instrument_tables import PlaneTable
from gtpin.instruments.instrument import Component, Unknown
from gtpin.instruments.targets import OfTargets, Targets, indices
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, left_jacobian
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats


class Plane(OfTargets):
    """Height z = n . (p - p0) - h of a target p over a plane, m; p0 is a point of the plane, n its unit normal, base frame.

    Without a column ``height`` the reading is 0: the target touches the plane. Unknown, in brackets the standard deviation of
    the prior: each plane's shift h along n, m (``plane_sigma``), its tilts a and b, rad (``normal_sigma``), which turn n to
    exp(a e_a + b e_b) n, with e_a and e_b as for tracks (docs/glossary.md), and the targets (``target_sigma``).
    """

    kind, Table = "plane", PlaneTable
    components = (Component("height", "m"),)
    table: PlaneTable

    def _unknowns(self) -> Sequence[Unknown]:
        table = self.table
        self.targets = Targets(table, self.read)
        self.plane = indices(self.read, "plane", dict(table.planes), "plane")
        self.point = np.array([plane.point for plane in table.planes.values()], dtype=float)
        normals = np.array([plane.normal for plane in table.planes.values()], dtype=float)
        self.normal = normals / np.linalg.norm(normals, axis=1)[:, None]
        self.axes = np.stack([rotation_axes(n)[:2] for n in self.normal])  # (K, 2, 3)
        height = self.read.numbers.get("height", np.zeros(self.read.count))
        self._height = np.where(np.isfinite(height), height, 0.0)
        kinds = (("height", "m", table.plane_sigma), ("a", "rad", table.normal_sigma), ("b", "rad", table.normal_sigma))
        own = [
            Unknown(f"{table.name}.plane[{plane}].{kind}", unit, 0.0, sigma)
            for plane in table.planes
            for kind, unit, sigma in kinds
        ]
        return self._identified((*self.targets.unknowns, *own))

    def measured(self) -> Floats:
        return self._height[:, None]

    def predicted(self, poses: Poses, u: Floats) -> Floats:
        t, shifts, tilts = self._split(u)
        away = self.targets.positions(poses, t) - self.point[self.plane]
        normal = self._normals(tilts)[self.plane]
        return np.asarray(((normal * away).sum(axis=1) - shifts[self.plane])[:, None])

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, 1, 6) derivative by the TCP's pose: component of the target's motion along the normal n."""
        t, _, tilts = self._split(u)
        return np.asarray(self._normals(tilts)[self.plane][:, None] @ self.targets.by_pose(poses, t))

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        """(M, 1, k) derivative by the targets, then by each plane's shift and tilts."""
        t, _, tilts = self._split(u)
        normals = self._normals(tilts)
        k = self.targets.count
        found = np.zeros((len(poses), 1, k + 3 * len(self.point)))
        found[:, :, :k] = normals[self.plane][:, None] @ self.targets.by_unknown(poses)
        away = self.targets.positions(poses, t) - self.point[self.plane]
        for i in range(len(self.point)):
            rows = self.plane == i
            vector = tilts[i] @ self.axes[i]
            turned = left_jacobian(vector) @ self.axes[i].T  # (3, 2) rotation vectors of the changes
            by_tilt = np.cross(turned.T, normals[i])  # (2, 3) changes of the normal
            found[rows, 0, k + 3 * i] = -1.0
            found[rows, 0, k + 3 * i + 1 : k + 3 * i + 3] = np.stack(
                [away[rows] @ change for change in by_tilt], axis=1
            )
        return found[:, :, self._kept]

    def _normals(self, tilts: Floats) -> Floats:
        """(K, 3) unit normals of the K planes, base frame."""
        return np.asarray(np.einsum("kij,kj->ki", exp(np.einsum("ki,kij->kj", tilts, self.axes)), self.normal))

    def _split(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Deviations of targets, shifts (K,) along the normals, and tilts (K, 2)."""
        whole, k = self._whole(u), self.targets.count
        own = whole[k:].reshape(-1, 3)
        return whole[:k], own[:, 0], own[:, 1:]
