"""The Gough-Stewart platform: six legs of variable length.

The machine of Wang and Masory, "On the accuracy of a Stewart platform. I. The effect of manufacturing tolerances", ICRA 1993,
in structure; the paper's dimensions were not at hand: these, and the masses, are ours.
"""

from __future__ import annotations

import numpy as np
from machine_sketch import Sketch, SketchRod

BASE, PLATFORM = 0.65, 0.35
"""Radii of the circles on which the joints lie, m."""
HALF = 12.0
"""Half the angle between neighbouring joints of a pair, degrees."""
HEIGHT = 0.95
"""Of the platform over the base at home, m."""
STROKE = 0.4
"""Of a leg, m; home is in its middle."""


def circle(radius: float, degrees: list[float]) -> np.ndarray:
    """(k, 3) points on a circle about z."""
    a = np.radians(degrees)
    return np.column_stack([radius * np.cos(a), radius * np.sin(a), np.zeros(len(a))])


def sketch() -> Sketch:
    thirds = (0.0, 120.0, 240.0)
    base = circle(BASE, [third + side for third in thirds for side in (-HALF, HALF)])
    # Legs cross over from a pair on the base to two pairs on the platform, which is turned by 60 degrees.
    platform = circle(PLATFORM, [third + side for third in thirds for side in (HALF - 60.0, 60.0 - HALF)])
    legs = [SketchRod(f"leg{i + 1}", platform[i], base[i], range=(0.0, STROKE), mass=6.0) for i in range(6)]
    return Sketch(
        "stewart",
        legs,
        home=[STROKE / 2.0] * 6,
        T=(0.0, 0.0, HEIGHT),
        plate_mass=25.0,
        plate_center=(0.0, 0.0, 0.05),
        tolerance={"link_length": 1e-3, "platform_joint": 1e-3, "base_joint": 1e-3, "scale": 5e-4},
        note="A Gough-Stewart platform: six legs of variable length. Structure: Wang, Masory 1993. Dimensions and masses are "
        "ours. Written by examples/machines/stewart.py.",
    )
