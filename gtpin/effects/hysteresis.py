"""Friction in guides and joints: what gives way under a load comes back short of where it was."""

from __future__ import annotations

import numpy as np

from gtpin.effects.effect import Floats
from gtpin.effects.sites import number
from gtpin.effects.situation import Situation


def approach(at: Situation, actuator: int | None) -> Floats:
    """(N,) -1 to 1: the direction in which an actuator came to rest; zero where the data of the fit did not tell it.

    Raises
    ------
    ModelError
        If the data of the fit did, and these do not.
    """
    if actuator is None:
        return np.zeros(len(at))
    name = f"approach{number(at.robot, at.robot.sites[actuator])}"
    return at.covariate(name) if at.has(name) else np.zeros(len(at))
