"""Loops that close in a plane alone: what is left across it holds for an exact geometry, and is taken up by play.

A spherical ``<loop_joint>`` gives three equations. In a planar loop, whose joints turn about parallel axes, the passive joints
answer to two of them; the third, across the plane, holds by itself in the nominal geometry and can't be met by any other. Real
machines meet it by play in their bearings.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

Floats = npt.NDArray[np.float64]

POSTURES = 6
"""Postures at which a loop's motions are compared: a plane is one at all of them."""
PARALLEL = 1e-5
"""Share of the motions in a plane below which those across it count as none: URDFs are written with five digits or more."""


def postures(model: Any, neutral: Floats) -> list[Floats]:
    """Configurations (nq,) around neutral, the same ones each time, in general position. Their loops need not be closed."""
    rng = np.random.default_rng(0)
    return [pin.integrate(model, neutral, rng.uniform(-0.5, 0.5, model.nv)) for _ in range(POSTURES)]


def normal_of(motions: Floats) -> Floats | None:
    """(3,) unit normal of the plane in which the motions (3, k) of a loop's gap lie; None where they span space or a line."""
    directions, sizes, _ = np.linalg.svd(motions)
    planar = len(sizes) == 3 and sizes[2] <= PARALLEL * sizes[0] < sizes[1]
    return np.asarray(directions[:, 2]) if planar else None


def in_planes(normals: list[Floats | None]) -> Floats:
    """(m, 3 k) what closure equations take of the gaps of k loops: two directions of planar loops, all three of others."""
    blocks = [np.eye(3) if normal is None else np.linalg.svd(normal[None])[2][1:] for normal in normals]
    found = np.zeros((sum(map(len, blocks)), 3 * len(blocks)))
    row = 0
    for i, block in enumerate(blocks):
        found[row : row + len(block), 3 * i : 3 * i + 3] = block
        row += len(block)
    return found
