"""Circles in a path about a point: its parts in one plane, with one radius, in one direction of travel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

STEP, JUMP = np.deg2rad(1.5), np.deg2rad(60.0)
"""Angle about the point by which a path goes on at least before its direction of travel is judged, and at most."""
KEPT = np.cos(np.deg2rad(35.0))
"""Cosine of the angle by which the axis of travel may turn from one step to the next."""
HALF = 0.98 * np.pi
"""Swept angle of a circle that is shown: half a turn, less the gap between its last and first readings."""
LEAST = 8
"""Readings of a circle that is shown."""
ROUND, FLAT = 0.15, 0.05
"""How far the radius of a circle may vary, and how far it may leave its plane, over its radius: a station that is set up by eye
makes the distance vary as well."""


@dataclass(frozen=True, eq=False)
class Run:
    """One way along a circle.

    Parameters
    ----------
    rows
        (m,) rows of the path, in the order of travel.
    normal
        (3,) unit normal of its plane, right-handed to the direction of travel.
    swept
        Swept angle, rad, above 0.
    """

    rows: Indices
    normal: Floats
    swept: float


def runs(away: Floats) -> list[Run]:
    """The circles of a path.

    Parameters
    ----------
    away
        (N, 3) from the point to the places of the path, in the order of travel, m.
    """
    found = [_run(np.arange(a, b), away[a:b]) for a, b in _parts(away)]
    return [run for run in found if run is not None]


def _parts(away: Floats) -> list[tuple[int, int]]:
    """First row, and the row after the last, of each part that goes about one axis."""
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
    """A part of a path as a circle; None if it is none."""
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
    """(3,) unit vectors e1 and e2 of a plane, e1 x e2 = normal: of a coordinate plane its axes, XY, YZ or ZX.

    e1 is the base's axis after the one that is nearest to the normal, projected to the plane.
    """
    first = np.zeros(3)
    first[(int(np.argmax(np.abs(normal))) + 1) % 3] = 1.0
    first -= (first @ normal) * normal
    first /= np.linalg.norm(first)
    return first, np.asarray(np.cross(normal, first))
