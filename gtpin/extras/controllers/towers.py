"""A linear delta with the dimensions of a firmware: the drives of its towers, and the dimensions that fit a machine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares, linear_sum_assignment

from gtpin.compensation.machine import CompensatedMachine
from gtpin.errors import ModelError
from gtpin.export.box import Box
from gtpin.extras.controllers.controller import controller_of, positions_to_ask_for
from gtpin.extras.importers.towers import Towers
from gtpin.model.model import Model
from gtpin.typing import Floats, Mask

CLOSE = 1e-5
"""Largest accepted difference, m, between a carriage's height computed with the firmware's dimensions and with the nominal
robot. Dimensions in firmware files are often rounded to 0.01 mm."""
POINTS = (9, 9, 5)
"""Number of points along x, y and z of the box at which the dimensions are fitted."""
USUAL = 1e-3
"""Usual change of a dimension: m for lengths, rad for angles, relative for scales."""
SLACK = 1e-7
"""Error of the TCP, m, that weighs as much in the fit as a change of a dimension by `USUAL`. Of dimensions that fit equally
well, those with the smallest change are taken."""

DIMENSIONS = (
    "delta radius",
    *(f"{what} {tower}" for what in ("arm", "angle", "end stop", "scale") for tower in "abc"),
)
"""The dimensions in their order in :attr:`Towers.values`."""
STEP = 1e-7
"""Step of a dimension, m, rad or relative, from which a derivative is computed."""


@dataclass(frozen=True, eq=False)
class Drives:
    """The actuator of each tower: q[actuator] = sign * height + zero, with the carriage's height above z = 0, m.

    ``towers``: the dimensions that the firmware is configured with, with scale 1. ``actuator``, ``sign``, ``zero``: (3,)
    actuator, sign and zero (m) of each tower.
    """

    towers: Towers
    actuator: npt.NDArray[np.intp]
    sign: Floats
    zero: Floats

    def commands(self, towers: Towers, xyz: Floats) -> Floats:
        """(N, 3) commands, m, that result for nozzles at ``xyz`` (N, 3), m, if the firmware has the dimensions ``towers``
        instead.

        The end stops stay where they are on the machine.
        """
        travel = (towers.tops - towers.heights(xyz)) / towers.scale
        q = np.empty_like(travel)
        q[:, self.actuator] = self.sign * (self.towers.tops - travel) + self.zero
        return q


def drives_of(towers: Towers, nominal: Model, box: Box) -> Drives:
    """Find the actuator of a nominal robot for each tower, by comparing carriage heights with commands over a box.

    Raises `ModelError` if the commands of the robot are not the heights of such carriages, up to sign and zero.
    """
    xyz = box.grid(*POINTS)
    height, q = towers.heights(xyz), controller_of(nominal, box.origin)(xyz)
    there = np.isfinite(height).all(axis=1) & np.isfinite(q).all(axis=1)
    hint = "give the dimensions that the robot was made from (examples/machines/printer.py), --origin and --box"
    if there.sum() < 4 or q.shape[1] != 3:
        raise ModelError(f"{nominal.robot.name} is no linear delta with these dimensions", hint=hint)
    height, q = height[there], q[there]
    h, p = height - height.mean(axis=0), q - q.mean(axis=0)
    apart = np.array([np.abs(p[:, None, :] - s * h[:, :, None]).max(axis=0) for s in (1.0, -1.0)])
    tower, actuator = linear_sum_assignment(apart.min(axis=0))
    worst = float(apart.min(axis=0)[tower, actuator].max())
    if worst > CLOSE:
        what = f"the carriages of {nominal.robot.name} move otherwise than by these dimensions, by {1e3 * worst:.3g} mm"
        raise ModelError(what, hint=hint)
    sign = np.where(apart[0] <= apart[1], 1.0, -1.0)[tower, actuator]
    return Drives(towers, actuator, sign, q.mean(axis=0)[actuator] - sign * height.mean(axis=0))


@dataclass(frozen=True, eq=False)
class TowerFit:
    """The fit of a delta's dimensions to a machine, at N points of a box.

    ``needed``: (N, 3) commands, m, that bring the machine's TCP to the points. ``jacobian``: (N, 3, 3) derivative of the TCP
    by the commands there. ``xyz``: (N, 3) the points, firmware's coordinates, m.
    """

    drives: Drives
    xyz: Floats
    needed: Floats
    jacobian: Floats

    @staticmethod
    def of(machine: CompensatedMachine, drives: Drives, box: Box) -> TowerFit:
        """The fit to a machine; raises `UnreachableError` if it can't reach all of the box."""
        wanted = box.grid(*POINTS)
        asked = positions_to_ask_for(machine, partial(drives.commands, drives.towers), box, wanted)
        needed = drives.commands(drives.towers, asked)
        kinematics = machine.model.kinematics
        jacobian = kinematics.command_jacobian(needed, kinematics.forward(needed))[:, :3]
        return TowerFit(drives, wanted, needed, jacobian)

    @property
    def _weight(self) -> float:
        return float(SLACK * np.sqrt(len(self.xyz)) / USUAL)

    def towers(self, free: Mask) -> Towers:
        """The dimensions with which the root mean square error of the TCP is smallest.

        ``free``: (13,) whether a dimension, in the order of :attr:`Towers.values`, may change.
        """
        start = self.drives.towers.values

        def changed(change: Floats) -> Towers:
            values = start.copy()
            values[free] += change
            return Towers.of(values)

        def residuals(change: Floats) -> Floats:
            off = np.einsum("nij,nj->ni", self.jacobian, self.drives.commands(changed(change), self.xyz) - self.needed)
            return np.concatenate([off.ravel(), self._weight * change])

        if not free.any():
            return self.drives.towers
        start_at = np.zeros(free.sum())
        return changed(least_squares(residuals, start_at, x_scale=USUAL, xtol=1e-15, ftol=1e-15, gtol=1e-15).x)

    def response(self, free: Mask) -> tuple[Floats, Floats]:
        """(3 N, 13) motion of the TCP by the dimensions, and (13, 3 N) change of the fitted dimensions by the TCP's error.

        Rows and columns of dimensions that are not ``free`` are zero.
        """
        start = self.drives.towers.values
        by = np.zeros((self.xyz.size, len(start)))
        plain = self.drives.commands(self.drives.towers, self.xyz)
        for k in np.flatnonzero(free):
            step = np.where(np.arange(len(start)) == k, STEP, 0.0)
            moved = (self.drives.commands(Towers.of(start + step), self.xyz) - plain) / STEP
            by[:, k] = np.einsum("nij,nj->ni", self.jacobian, moved).ravel()
        return by, np.asarray(-np.linalg.solve(by.T @ by + self._weight**2 * np.eye(len(start)), by.T))
