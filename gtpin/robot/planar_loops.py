"""Planar loops, whose joints turn about parallel axes: gtpin closes them in their plane only.

A spherical ``<loop_joint>`` gives three equations. The passive joints of a planar loop can satisfy two of them. The third,
across the plane, holds in the nominal geometry, and can't be satisfied in one with deviations. A real machine has play in its
bearings for it. The loop of a spherical linkage, all of whose axes meet in one point, is the same: its anchors move on a
sphere, and its plane is the sphere's tangent plane, which is fixed in the frame of the first anchor.
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
EVERY, NONE = np.eye(3), np.zeros((0, 3))


def postures(model: Any, neutral: Floats) -> list[Floats]:
    """Random configurations (nq,) around the neutral one, the same in each call. Their loops need not be closed."""
    rng = np.random.default_rng(0)
    return [pin.integrate(model, neutral, rng.uniform(-0.5, 0.5, model.nv)) for _ in range(POSTURES)]


def normal_of(motions: Floats, zero: float = PARALLEL) -> Floats:
    """(1, 3) unit normal of the plane of motions (3, k) of one anchor relative to the other; (0, 3) where they span no plane.

    ``zero``: ratio of motions across the plane to those in it below which they count as zero.
    """
    directions, sizes, _ = np.linalg.svd(motions)
    planar = len(sizes) == 3 and sizes[2] <= zero * sizes[0] < sizes[1]
    return np.asarray(directions[:, 2:].T) if planar else NONE


def of_further_point(normals: Floats, axis: str) -> Floats:
    """(k, 3) directions in which the second or third point of a loop of type ``fixed`` is not closed.

    Two frames coincide if their origins do, the point on x in y and z, and the point on y in z. In a plane one equation is
    enough: the point farther off the normal, along the plane and across its lever.

    ``normals``: those of the loop's origin. ``axis``: ``x`` or ``y``.
    """
    if not len(normals):
        return EVERY[:1] if axis == "x" else EVERY[:2]
    ways = np.cross(normals[0], EVERY[:2])
    lengths = np.linalg.norm(ways, axis=1)
    point = int(np.argmax(lengths))
    return axes_of(ways[point : point + 1] / lengths[point]) if axis == "xy"[point] and len(normals) == 1 else EVERY


def axes_of(normals: Floats) -> Floats:
    """(3 - k, 3) orthogonal unit vectors across orthogonal normals (k, 3)."""
    return np.asarray(np.linalg.svd(normals)[2][len(normals) :])


def in_planes(normals: tuple[Floats, ...]) -> Floats:
    """(m, 3 L) matrix that gives the closure equations, from the vectors between the anchors of L loops.

    Of three components of a vector, those along the normals (k, 3) of a loop are no equations.
    """
    blocks = [axes_of(normal) if len(normal) else EVERY for normal in normals]
    found = np.zeros((sum(map(len, blocks)), 3 * len(blocks)))
    row = 0
    for i, block in enumerate(blocks):
        found[row : row + len(block), 3 * i : 3 * i + 3] = block
        row += len(block)
    return found
