"""Tilt sensors: the first two components, in the sensor's frame, of the unit vector against gravity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.data.instrument_tables import TiltTable
from gtpin.instruments.frame_and_target import nearest
from gtpin.instruments.instrument import Component, Instrument, RowError, Unknown
from gtpin.instruments.tracker import TURNS
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, left_jacobian, log, skew
from gtpin.typing import Floats

MOST = 1.05
"""Largest length of the two components of a unit vector that noise of a sensor can cause. Assumed."""
ANY, FEWEST = 0.3, 6
"""Prior sigma of the mounting, rad, from which its first guess is found from the readings, and readings that this takes."""


class Tilt(Instrument):
    """x and y component of S' up, with up the unit vector against gravity and S = R exp(m) the sensor's orientation.

    Small components are angles in rad. R is the rotation from the TCP frame to the base frame, or from the frame of ``link``
    that the robot's file gives it, as displaced as the joints below it: a link that bends turns what it carries, not itself.
    Unknown: the rotation vector m of the sensor's mounting in that frame, rad (standard deviation of its prior:
    ``mount_sigma``).
    """

    kind, Table = "tilt", TiltTable
    components = (Component("tilt_x", "rad", initial_sigma=5e-5), Component("tilt_y", "rad", initial_sigma=5e-5))
    table: TiltTable

    def _unknowns(self) -> Sequence[Unknown]:
        name, sigma = self.table.name, self.table.mount_sigma
        return self._identified([Unknown(f"{name}.mount.{axis}", "rad", 0.0, sigma) for axis in TURNS])

    def check(self) -> None:
        size = np.hypot(self.read.numbers["tilt_x"], self.read.numbers["tilt_y"])
        bad = np.flatnonzero(size > MOST)
        if len(bad):
            hint = "tilts are components of a unit vector: rad for small angles, not degrees or mm/m"
            raise RowError(int(bad[0]), f"tilts of {size[bad[0]]:.4g} together can't be", "tilt_x tilt_y", hint)

    def start(self, nominal: Poses) -> Floats:
        """(k,) first guess of the mounting: zeros, or from a linear fit where its prior lets it turn far."""
        if self.table.mount_sigma < ANY or self.read.count < FEWEST:
            return np.zeros(len(self.unknowns))
        x, y = np.linalg.lstsq(self._up(nominal), self.measured(), rcond=None)[0].T  # columns of exp(m)
        return np.asarray(log(nearest(np.column_stack([x, y, np.cross(x, y)]))[None])[0])

    def predicted(self, poses: Poses, u: Floats) -> Floats:
        return np.asarray(self._up(poses) @ exp(self._whole(u)))[:, :2]

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        found = np.zeros((len(poses), 2, 6))
        if self.table.link is None:
            found[:, :, 3:] = self._by_turn(poses, u)
        return found

    def by_links(self, poses: Poses, u: Floats) -> Floats:
        found = np.zeros((len(poses), 2, 3 * len(poses.links)))
        for i, name in enumerate(poses.links):
            if name == self.table.link:
                found[:, :, 3 * i : 3 * i + 3] = self._by_turn(poses, u)
        return found

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        mount = self._whole(u)
        return np.asarray((exp(mount).T @ skew(self._up(poses)) @ left_jacobian(mount))[:, :2, self._kept])

    def _carrier(self, poses: Poses) -> Floats:
        """(M, 3, 3) rotations of what the sensor sits on, to the base frame."""
        return poses.R if self.table.link is None else poses.links[self.table.link]

    def _up(self, poses: Poses) -> Floats:
        """(M, 3) the unit vector against gravity, in the frame of what the sensor sits on."""
        return np.asarray(np.swapaxes(self._carrier(poses), 1, 2) @ self.up)

    def _by_turn(self, poses: Poses, u: Floats) -> Floats:
        """(M, 2, 3) derivative by a rotation vector, rad, base frame, of what the sensor sits on."""
        return np.asarray((exp(self._whole(u)).T @ np.swapaxes(self._carrier(poses), 1, 2) @ skew(self.up))[:, :2])
