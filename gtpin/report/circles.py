"""Circles in a path about a point: parts of the path in one plane, with one radius, in one direction of travel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.typing import Floats, Indices

STEP, JUMP = np.deg2rad(1.5), np.deg2rad(60.0)
"""Smallest step of a path, as an angle about the point, from which its direction of travel is determined, and the largest step
within one circle."""
KEPT = np.cos(np.deg2rad(35.0))
"""Cosine of the largest angle by which the axis of travel may change from one step to the next."""
HALF = 0.98 * np.pi
"""Smallest swept angle of a circle that is shown, rad: half a turn, less the gap between its last and first readings."""
LEAST = 8
"""Smallest number of readings of a circle that is shown."""
ROUND, FLAT = 0.15, 0.05
"""Largest variation of a circle's radius, and largest distance from its plane, over its radius. A station that is set up by eye
is not at the circle's centre, so that the distance from it varies."""


@dataclass(frozen=True, eq=False)
class Run:
    """One run along a circle.

    Parameters
    ----------
    rows
        (m,) rows of the path, in the order of travel.
    normal
        (3,) unit normal of its plane; the direction of travel is counterclockwise about it.
    swept
        Swept angle, rad, positive.
    """

    rows: Indices
    normal: Floats
    swept: float


def runs(away: Floats) -> list[Run]:
    """The circles of a path.

    Parameters
    ----------
    away
        (N, 3) vectors from the point to the positions of the path, in the order of travel, m.
    """
    found = [_run(np.arange(a, b), away[a:b]) for a, b in _parts(away)]
    return [run for run in found if run is not None]


def _parts(away: Floats) -> list[tuple[int, int]]:
    """First row, and the row after the last, of each part that turns about one axis."""
    direction = away / np.maximum(np.linalg.norm(away, axis=1), 1e-12)[:, None]
    starts, last, axis = [0], 0, None
    for i in range(1, len(direction)):
        cross = np.cross(direction[last], direction[i])
        sine = float(np.linalg.norm(cross))
        angle = float(np.arctan2(sine, direction[last] @ direction[i]))
        if angle > JUMP:
            starts.append(i)
            last, axis = i, None
        elif angle >= STEP:
            turning = cross / sine
            if axis is not None and float(turning @ axis) < KEPT:
                starts.append(last + 1)  # the path turned back, or left the plane, after the last step
                turning = None
            last, axis = i, turning
    return list(zip(starts, [*starts[1:], len(away)], strict=True))


def _run(rows: Indices, away: Floats) -> Run | None:
    """A part of a path as a circle; None if it is no circle."""
    if len(rows) < LEAST:
        return None
    middle = away.mean(axis=0)
    normal = np.linalg.svd(away - middle, full_matrices=False)[2][2]
    radius = np.linalg.norm(away, axis=1)
    if np.abs(radius / radius.mean() - 1.0).max() > ROUND:
        return None
    if np.abs((away - middle) @ normal).max() > FLAT * radius.mean():
        return None
    across, along = plane_axes(normal)
    angle = np.unwrap(np.arctan2(away @ along, away @ across))
    swept = float(angle[-1] - angle[0])
    if abs(swept) < HALF:
        return None
    return Run(rows, normal if swept > 0.0 else -normal, abs(swept))


def plane_axes(normal: Floats) -> tuple[Floats, Floats]:
    """(3,) unit vectors e1 and e2 of a plane, with e1 x e2 = normal; of the planes XY, YZ and ZX, their axes.

    e1 is a base axis, projected on the plane: in the cyclic order x, y, z the one after the axis that is nearest to the normal.
    """
    first = np.zeros(3)
    first[(int(np.argmax(np.abs(normal))) + 1) % 3] = 1.0
    first -= (first @ normal) * normal
    first /= np.linalg.norm(first)
    return first, np.asarray(np.cross(normal, first))
