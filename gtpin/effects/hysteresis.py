"""Hysteresis from friction in guides and joints: a deflection under load depends on the direction of approach."""

from __future__ import annotations

import numpy as np

from gtpin.effects.sites import number
from gtpin.effects.situation import Situation
from gtpin.typing import Floats


def approach(at: Situation, actuator: int | None) -> Floats:
    """(N,) direction of approach of an actuator, -1 to 1; zero where the data of the fit did not contain it.

    It is +1 where the actuator moved towards larger commands before it stopped, and -1 where towards smaller ones.

    Raises
    ------
    ModelError
        If the data of the fit contained it, and these data do not.
    """
    if actuator is None:
        return np.zeros(len(at))
    name = f"approach{number(at.robot, at.robot.sites[actuator])}"
    return at.covariate(name) if at.has(name) else np.zeros(len(at))
