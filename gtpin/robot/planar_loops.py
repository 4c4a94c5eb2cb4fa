"""Planar loops, whose joints turn about parallel axes: gtpin closes them in their plane only.

A spherical ``<loop_joint>`` gives three equations. The passive joints of a planar loop can satisfy two of them. The third,
across the plane, holds in the nominal geometry, and can't be satisfied in one with deviations. A real machine has play in its
bearings for it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.typing import Floats

POSTURES = 6
"""Number of postures at which a loop's motions are examined: a planar loop moves in its plane at all of them. Assumed."""
PARALLEL = 1e-5
"""Ratio of motions across a plane to those in it, below which they count as zero: URDFs have at least five digits. Assumed."""


def postures(model: Any, neutral: Floats) -> list[Floats]:
    """Random configurations (nq,) around the neutral one, the same in each call. Their loops need not be closed."""
    rng = np.random.default_rng(0)
    return [pin.integrate(model, neutral, rng.uniform(-0.5, 0.5, model.nv)) for _ in range(POSTURES)]


def normal_of(motions: Floats) -> Floats | None:
    """(3,) unit normal of the plane of motions (3, k) of one anchor relative to the other; None where they span no plane."""
    directions, sizes, _ = np.linalg.svd(motions)
    planar = len(sizes) == 3 and sizes[2] <= PARALLEL * sizes[0] < sizes[1]
    return np.asarray(directions[:, 2]) if planar else None


def axes_of(normal: Floats) -> Floats:
    """(2, 3) unit vectors that span the plane of a normal (3,)."""
    return np.asarray(np.linalg.svd(normal[None])[2][1:])


def in_planes(normals: list[Floats | None]) -> Floats:
    """(m, 3 k) matrix that gives the closure equations, from the vectors between the anchors of k loops.

    A planar loop, with a normal, has two equations, in its plane; any other loop has three.
    """
    blocks = [np.eye(3) if normal is None else axes_of(normal) for normal in normals]
    found = np.zeros((sum(map(len, blocks)), 3 * len(blocks)))
    row = 0
    for i, block in enumerate(blocks):
        found[row : row + len(block), 3 * i : 3 * i + 3] = block
        row += len(block)
    return found
