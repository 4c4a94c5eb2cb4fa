"""A square part of a plane, to draw the plane."""

from __future__ import annotations

import numpy as np

from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats


def patch(point: Floats, normal: Floats, half: float) -> Floats:
    """(4, 3) corners of a square about a point of a plane, base frame, m, counterclockwise about the normal.

    Parameters
    ----------
    point, normal
        (3,) middle of the square, m, and its unit normal.
    half
        Half its side, m.
    """
    first, second = rotation_axes(normal)[:2]
    return np.array(
        [point + half * (a * first + b * second) for a, b in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))]
    )
