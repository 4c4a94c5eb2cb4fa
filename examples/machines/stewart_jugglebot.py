"""Jugglebot's Stewart platform: a real machine, whose six legs are drawn by cords on spools.

Nominal geometry of github.com/Project-DeepBlue-Juggling/Jugglebot, MIT licence, Copyright (c) 2022 Jugleer (the licence's text
is in examples/jugglebot/LICENSE); home is the platform level and 0.565 m above the base, with all legs at zero. Masses are
ours, and so are tolerances: of the heights of the joint planes little is known. So is the legs' compliance, by its order of
magnitude: a cord and a motor that holds its place by a control loop are some thousand times as soft as a rod of steel.
"""

from __future__ import annotations

from machine_sketch import Sketch, SketchRod

BASE = (
    (-0.385274, -0.140228, 0.0),
    (-0.314078, -0.263543, 0.0),
    (0.314078, -0.263543, 0.0),
    (0.385274, -0.140228, 0.0),
    (0.071196, 0.403771, 0.0),
    (-0.071196, 0.403771, 0.0),
)
PLATFORM = (
    (-0.197405, 0.095000, 0.0),
    (-0.016431, -0.218458, 0.0),
    (0.016431, -0.218458, 0.0),
    (0.197405, 0.095000, 0.0),
    (0.180975, 0.123458, 0.0),
    (-0.180975, 0.123458, 0.0),
)
LENGTH, STROKE, HEIGHT = 0.640197, 0.285, 0.565


def sketch() -> Sketch:
    legs = [
        SketchRod(f"leg{i + 1}", PLATFORM[i], BASE[i], range=(0.0, STROKE), length=LENGTH, mass=0.5, scale_unknown=True)
        for i in range(6)
    ]
    return Sketch(
        "stewart_jugglebot",
        legs,
        home=[0.0] * 6,
        T=(0.0, 0.0, HEIGHT),
        plate_mass=1.5,
        tolerance={
            "link_length": 5e-2,
            "platform_joint": 5e-3,
            "platform_joint_z": 3e-2,
            "base_joint": 5e-3,
            "base_joint_z": 3e-2,
            "scale": 5e-2,
        },
        link_compliance=1e-4,
        note="Jugglebot's Stewart platform: nominal geometry of github.com/Project-DeepBlue-Juggling/Jugglebot (MIT licence, "
        "Copyright (c) 2022 Jugleer). Masses, tolerances and the legs' compliance are ours. "
        "Written by examples/machines/stewart_jugglebot.py.",
    )
