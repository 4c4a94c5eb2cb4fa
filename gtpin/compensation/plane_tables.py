"""The correction that Klipper and RepRapFirmware share: an offset, skew of the axes, and heights on a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.compensation.box import Box
from gtpin.compensation.controller import Controller, positions_to_ask_for
from gtpin.compensation.machine import Machine

Floats = npt.NDArray[np.float64]

NODES = 21
"""Nodes of the grid along x and y: 441, the most that RepRapFirmware takes on its smaller boards (MaxGridProbePoints)."""
LEVELS = 3
"""Heights of the box at which a correction is computed; a grid of heights holds their mean."""
COARSE = 7
"""Points along x and y from which offset and skew are computed."""


@dataclass(frozen=True, eq=False)
class PlaneTables:
    """x += offset_x + xy y + xz z; y += offset_y + yz z; then z += height(x, y), interpolated bilinearly. In m.

    Parameters
    ----------
    offset
        (2,) offsets of x and y, m.
    skew
        (3,) xy, xz, yz.
    x, y
        (NODES,) nodes of the grid, m.
    height
        (NODES, NODES) heights, m; row i is at y[i].
    """

    offset: Floats
    skew: Floats
    x: Floats
    y: Floats
    height: Floats

    def applied(self, xyz: Floats) -> Floats:
        """(N, 3) positions that the controller moves to for commanded positions (N, 3), m. Outside the grid, its edge is
        used."""
        p = _skewed(xyz, self.offset, self.skew)
        across, i = _cell(self.x, p[:, 0])
        along, j = _cell(self.y, p[:, 1])
        h = self.height
        near = (1.0 - across) * h[j, i] + across * h[j, i + 1]
        far = (1.0 - across) * h[j + 1, i] + across * h[j + 1, i + 1]
        p[:, 2] += (1.0 - along) * near + along * far
        return p


def plane_tables(machine: Machine, controller: Controller, box: Box) -> PlaneTables:
    """The correction of a machine in a box; offset and skew by least squares, heights as the mean over the box's height.

    Raises
    ------
    UnreachableError
        If the machine can't reach all of the box.
    """
    wanted = box.grid(COARSE, COARSE, LEVELS)
    # An offset changes y before it is multiplied by the skew: a product of two errors, below a nanometre here.
    change = positions_to_ask_for(machine, controller, box, wanted) - wanted
    one, y, z = np.ones(len(wanted)), wanted[:, 1], wanted[:, 2]
    ox, xy, xz = np.linalg.lstsq(np.column_stack([one, y, z]), change[:, 0], rcond=None)[0]
    oy, yz = np.linalg.lstsq(np.column_stack([one, z]), change[:, 1], rcond=None)[0]
    offset, skew = np.array([ox, oy]), np.array([xy, xz, yz])
    nodes = box.grid(NODES, NODES, LEVELS)
    # The heights stand at positions that offset and skew have changed already.
    wanted = nodes - (_skewed(nodes, offset, skew) - nodes)
    height = (positions_to_ask_for(machine, controller, box, wanted) - wanted)[:, 2]
    x, y = (np.linspace(box.low[k], box.high[k], NODES) for k in (0, 1))
    return PlaneTables(offset, skew, x, y, height.reshape(LEVELS, NODES, NODES).mean(axis=0))


def _skewed(xyz: Floats, offset: Floats, skew: Floats) -> Floats:
    p = xyz.copy()
    p[:, :2] += offset
    y = p[:, 1].copy()
    p[:, 0] += skew[0] * y + skew[1] * p[:, 2]
    p[:, 1] += skew[2] * p[:, 2]
    return p


def _cell(nodes: Floats, at: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
    """(N,) fractions within the cell, 0 to 1, and (N,) its first node."""
    i = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, len(nodes) - 2)
    return np.clip((at - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0, 1.0), i
