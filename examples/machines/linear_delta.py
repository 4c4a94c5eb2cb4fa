"""The linear delta: three upright tracks and six equal rods in parallel pairs.

Proportions of the printer that Klipper's config/example-delta.cfg describes (arm_length 333 mm, delta_radius 174.75 mm, towers
at 210, 330 and 90 degrees), three times as large; the width of the pairs, the height and the masses are ours.
"""

from __future__ import annotations

import numpy as np
from machine_sketch import Carrier, Sketch, SketchRod

ARM, RADIUS = 3.0 * 0.333, 3.0 * 0.17475
"""Length of the rods, and of their horizontal projection in the middle, m."""
TOWERS = np.radians([210.0, 330.0, 90.0])
EFFECTOR = 0.10
"""From the TCP's axis to the middle of a pair, m."""
WIDTH = 0.18
"""Between the rods of a pair, m."""
NOZZLE = 0.05
"""Of the TCP below the joints, m."""
HOME = 0.30
"""Of the TCP over the base at home, m."""


def sketch() -> Sketch:
    carriers, rods = [], []
    height = HOME + NOZZLE + np.sqrt(ARM**2 - RADIUS**2)
    for tower, angle in enumerate(TOWERS):
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        aside = np.array([-out[1], out[0], 0.0])
        cart = f"cart{tower + 1}"
        middle = (RADIUS + EFFECTOR) * out + np.array([0.0, 0.0, height])
        carriers.append(Carrier(cart, middle, (0.0, 0.0, 1.0), (-0.4, 0.4), mass=3.0))
        for name, side in (("a", -0.5), ("b", 0.5)):
            joint = EFFECTOR * out + side * WIDTH * aside + np.array([0.0, 0.0, NOZZLE])
            rods.append(
                SketchRod(f"link{tower + 1}{name}", joint, middle + side * WIDTH * aside, carrier=cart, mass=0.6)
            )
    return Sketch(
        "linear_delta",
        rods,
        carriers,
        home=(0.0, 0.0, 0.0),
        T=(0.0, 0.0, HOME),
        plate_mass=8.0,
        plate_center=(0.0, 0.0, NOZZLE),
        tolerance={
            "link_length": 1e-3,
            "platform_joint": 1e-3,
            "cart_joint": 2e-3,
            "track_direction": 1e-3,
            "scale": 5e-4,
        },
        note="A linear delta: three upright tracks, six equal rods. Proportions of Klipper's config/example-delta.cfg, three "
        "times as large; pair width, height and masses are ours. Written by examples/machines/linear_delta.py.",
    )
