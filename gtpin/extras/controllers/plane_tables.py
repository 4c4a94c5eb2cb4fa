"""The correction that Klipper and RepRapFirmware share: an offset, skew of the axes, and heights on a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.compensation.machine import CompensatedMachine
from gtpin.export.box import Box
from gtpin.extras.controllers.controller import Controller, positions_to_ask_for
from gtpin.typing import Floats, Mask

NODES = 21
"""Number of nodes along x, and along y. Their 441 points are the largest number that RepRapFirmware accepts on its smaller
boards (MaxGridProbePoints)."""
LEVELS = 3
"""Number of heights in the box at which a correction in z is computed; the table has the mean over them."""
COARSE = 7
"""Number of points along x, and along y, from which offset and skew are computed."""

PARTS = (
    "offset x",
    "offset y",
    "skew xy",
    "skew xz",
    "skew yz",
    "height",
    "tilt along x",
    "tilt along y",
    "unevenness",
)
"""The parts of the correction; the last four are those of the heights: mean, slopes, and what is no plane."""


@dataclass(frozen=True, eq=False)
class PlaneTables:
    """Changes of commanded positions, m, in the controller's coordinates.

    First y += offset_y and x += offset_x, then x += xy y + xz z and y += yz z, with the y before this step in the first
    formula. Last z += height(x, y), interpolated bilinearly.

    - ``offset``: (2,) offsets of x and y, m.
    - ``skew``: (3,) xy, xz, yz: tangents of the angles between the axes, less the right angles.
    - ``x``, ``y``: (NODES,) nodes of the grid, m.
    - ``height``: (NODES, NODES) additions to z, m; row i is at y[i], column j at x[j].
    """

    offset: Floats
    skew: Floats
    x: Floats
    y: Floats
    height: Floats

    def only(self, kept: Mask) -> PlaneTables:
        """The tables with those of their ``PARTS`` alone that are ``kept``."""
        of_plane = np.linalg.pinv(self._plane) @ self.height.ravel()
        heights = self._plane @ (of_plane * kept[5:8])
        heights += (self.height.ravel() - self._plane @ of_plane) * kept[8]
        offset, skew = self.offset * kept[:2], self.skew * kept[2:5]
        return PlaneTables(offset, skew, self.x, self.y, heights.reshape(self.height.shape))

    @property
    def _plane(self) -> Floats:
        y, x = np.meshgrid(self.y, self.x, indexing="ij")
        return np.column_stack([np.ones(x.size), x.ravel(), y.ravel()])

    def applied(self, xyz: Floats) -> Floats:
        """(N, 3) positions that the controller moves to for commanded positions (N, 3), m.

        Outside the grid, the height at its edge is used.
        """
        from scipy.interpolate import RegularGridInterpolator

        p = _skewed(xyz, self.offset, self.skew)
        x, y = np.clip(p[:, 0], self.x[0], self.x[-1]), np.clip(p[:, 1], self.y[0], self.y[-1])
        p[:, 2] += RegularGridInterpolator((self.y, self.x), self.height)((y, x))
        return p


def plane_tables(machine: CompensatedMachine, controller: Controller, box: Box) -> PlaneTables:
    """The correction of a machine in a box: offset and skew by least squares, then the heights, as a mean over `LEVELS`.

    Raises `UnreachableError` if the machine can't reach all of the box.
    """
    wanted = box.grid(COARSE, COARSE, LEVELS)
    # The fit leaves out that the skew multiplies a y that the offset has changed: a product of two small numbers. For an
    # offset of 1 mm and a skew of 0.001, it is 1 um.
    change = positions_to_ask_for(machine, controller, box, wanted) - wanted
    one, y, z = np.ones(len(wanted)), wanted[:, 1], wanted[:, 2]
    ox, xy, xz = np.linalg.lstsq(np.column_stack([one, y, z]), change[:, 0], rcond=None)[0]
    oy, yz = np.linalg.lstsq(np.column_stack([one, z]), change[:, 1], rcond=None)[0]
    offset, skew = np.array([ox, oy]), np.array([xy, xz, yz])
    nodes = box.grid(NODES, NODES, LEVELS)
    # The table is read at x and y that offset and skew have changed already: compute the heights for those.
    wanted = nodes - (_skewed(nodes, offset, skew) - nodes)
    height = (positions_to_ask_for(machine, controller, box, wanted) - wanted)[:, 2]
    x, y = (np.linspace(box.low[k], box.high[k], NODES) for k in (0, 1))
    return PlaneTables(offset, skew, x, y, height.reshape(LEVELS, NODES, NODES).mean(axis=0))


def changes_of_parts(xyz: Floats, error: Floats) -> list[Floats]:
    """Size of each of the ``PARTS``, (..., k), for errors (N, 3, k) of the TCP at points ``xyz`` (N, 3), m."""
    one, x, y, z = np.ones(len(xyz)), *xyz.T
    plane = np.column_stack([one, x, y])
    of_plane = np.linalg.pinv(plane) @ error[:, 2]
    ox, xy, xz = np.linalg.pinv(np.column_stack([one, y, z])) @ error[:, 0]
    oy, yz = np.linalg.pinv(np.column_stack([one, z])) @ error[:, 1]
    return [ox, oy, xy, xz, yz, *of_plane, np.asarray(error[:, 2] - plane @ of_plane)]


def _skewed(xyz: Floats, offset: Floats, skew: Floats) -> Floats:
    """(N, 3) positions with offset and skew, m."""
    p = xyz.copy()
    p[:, :2] += offset
    y = p[:, 1].copy()
    p[:, 0] += skew[0] * y + skew[1] * p[:, 2]
    p[:, 1] += skew[2] * p[:, 2]
    return p
