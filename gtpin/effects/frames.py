"""Motions of the measurement frame."""

from __future__ import annotations

import numpy as np

from gtpin.effects.situation import Situation
from gtpin.kinematics.rotations import frame_motions
from gtpin.typing import Floats

SHIFT, TURN = 4e-5, 1.5e-5
"""Typical sizes of a frame's motion, m and rad."""
FREEDOMS = tuple((f"{kind}_{axis}", unit) for kind, unit in (("shift", "m"), ("turn", "rad")) for axis in "xyz")
"""Names and units of a frame's six degrees of freedom."""


def frame_twist(at: Situation) -> tuple[Floats, Floats]:
    """(N, 6, 6) motion of the measured pose per unit shift, m, and turn, rad, of the frame, and (6,) their typical sizes.

    Shifts and turns are along and about the axes of the base frame, turns about the TCP at home.
    """
    return frame_motions(at.poses.T - at.kinematics.home.T[0]), np.array([SHIFT] * 3 + [TURN] * 3)
