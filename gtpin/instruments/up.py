"""The direction against gravity."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.robot.robot import Robot


def up_of(robot: Robot) -> npt.NDArray[np.float64]:
    """(3,) unit vector against gravity, base frame; along z where the robot has no gravity."""
    gravity = np.array(robot.description.gravity, dtype=float)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
