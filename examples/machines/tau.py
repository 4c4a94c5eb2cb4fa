"""The 3-DOF rotary Tau robot: three arms on one column, with one, two and three rods.

The structure is that of Cui, Zhu, Gan and Brogardh, "Kinematic analysis and error modeling of TAU parallel robot", Robotics
and Computer-Integrated Manufacturing 21 (2005) 497-505. Dimensions and masses are ours: the paper's were not at hand.
"""

from __future__ import annotations

import numpy as np
from machine_sketch import Carrier, Sketch, SketchRod

COLUMN = np.array([0.0, 0.0, 1.0])
REACH = 0.8
"""From the column's axis to the middle of the joints on an arm, m."""
HEIGHT = (0.2, 0.3, 1.2)
ANGLE = np.radians([30.0, -75.0, 40.0])
"""Of the arms at zero commands, about the column."""
PLATFORM = np.array([[0.0, 0.10, -0.05], [0.0, -0.10, -0.05], [-0.05, 0.0, 0.10]])
"""Middle of each arm's joints on the platform, TCP frame, m."""
OFFSETS = (
    (("1", (0.0, 0.0, 0.0)),),
    (("2a", (0.0, 0.0, 0.10)), ("2b", (0.0, 0.0, -0.10))),
    (("3a", (0.10, 0.10, 0.0)), ("3b", (0.01, -0.11, 0.09)), ("3c", (-0.11, 0.01, -0.09))),
)
"""From there, and on the arm, to each rod's joints: equal, so that the rods of an arm are parallel and the platform turns
about the upright with arm 3 alone. The pair of arm 2 is upright, so that it stays parallel as the two turn."""


def sketch() -> Sketch:
    carriers, rods = [], []
    for arm, (height, angle) in enumerate(zip(HEIGHT, ANGLE, strict=True)):
        site, axis = f"arm{arm + 1}", np.array([0.0, 0.0, height])
        carriers.append(Carrier(site, axis, COLUMN, (-0.5, 0.5), turns=True, mass=15.0))
        tip = axis + REACH * np.array([np.cos(angle), np.sin(angle), 0.0])
        for name, offset in OFFSETS[arm]:
            rods.append(SketchRod(f"link{name}", PLATFORM[arm] + offset, tip + offset, carrier=site, mass=1.5))
    return Sketch(
        "tau",
        rods,
        carriers,
        home=(0.0, 0.0, 0.0),
        T=(1.1, 0.0, 0.55),
        plate_mass=12.0,
        plate_center=(0.0, 0.0, 0.03),
        tolerance={"link_length": 1e-3, "platform_joint": 1e-3, "arm_joint": 2e-3, "arm_axis": 1e-3, "scale": 5e-4},
        note="The 3-DOF rotary Tau robot. Structure: Cui, Zhu, Gan, Brogardh 2005. Dimensions and masses are ours. Written "
        "by examples/machines/tau.py.",
    )
